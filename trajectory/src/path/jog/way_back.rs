//! The way back to the path that axes were jogged off.
//!
//! Without a [`Retraction`] it is one straight line, which knows of no work piece. With one it is up to three
//! legs, each from rest to rest and each for a person to begin: up to the clearance, over to above the
//! place where the path was left, down to that place. Which one is next follows from where the axes rest, and from
//! nothing else. So whatever a person does between two of them, also a hold in the midst of one or another
//! jog, what comes next is right, and nothing has to be remembered.
//!
//! No leg moves sideways below the clearance: only axes that rest at it or higher go over, and only the
//! retraction's axis moves in the two other legs.

/// How the axes go back to the path where a straight line might meet what is being machined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Retraction {
    /// The axis that lifts the tool off, in its positive direction.
    pub axis: usize,
    /// From this position of it on, mm, nothing is in the way of the other axes.
    pub clearance: f64,
    /// It goes down to the path at most so fast, mm/s.
    pub approach: f64,
}

/// A straight part of the way back, from rest to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg<const N: usize> {
    /// Which axes move, and where to, mm.
    pub to: [Option<f64>; N],
    /// At most so fast along it, mm/s; infinite: as fast as the axes can.
    pub speed: f64,
    /// It ends on the path.
    pub last: bool,
}

impl Retraction {
    /// The next leg of the way from a place off the path; `None` on it.
    #[must_use]
    pub fn leg<const N: usize>(&self, from: &[f64; N], home: &[f64; N]) -> Option<Leg<N>> {
        let missing: [Option<f64>; N] =
            std::array::from_fn(|i| (from[i] != home[i]).then_some(home[i]));
        let (height, end) = (from[self.axis], home[self.axis]);
        let aside = (missing.iter().enumerate()).any(|(i, it)| i != self.axis && it.is_some());
        let clear = self.clearance.max(end);
        let mut leg = Leg {
            to: missing,
            speed: f64::INFINITY,
            last: !aside || height == end,
        };
        if !aside {
            let down = missing[self.axis].is_some_and(|end| end < height);
            leg.speed = if down { self.approach } else { leg.speed };
        } else if height < clear {
            leg.to = [None; N];
            leg.to[self.axis] = Some(clear);
            leg.last = false;
        } else {
            leg.to[self.axis] = None;
        }
        leg.to.iter().any(Option::is_some).then_some(leg)
    }
}
