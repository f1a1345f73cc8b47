//! The first of what a run may have any number of. A machine may stay on for days, and a program may switch an
//! output a million times: what is kept of that does not grow with it, and what is left off is counted.

/// Of each kind so many are kept.
const MOST: usize = 10_000;

/// See the module.
#[derive(Debug)]
pub(super) struct Kept<T> {
    first: Vec<T>,
    left_off: u64,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self {
            first: Vec::new(),
            left_off: 0,
        }
    }
}

impl<T> Kept<T> {
    /// Takes another one.
    pub(super) fn push(&mut self, another: T) {
        if self.first.len() < MOST {
            self.first.push(another);
        } else {
            self.left_off += 1;
        }
    }

    /// The first one.
    pub(super) fn first(&self) -> Option<&T> {
        self.first.first()
    }

    /// The last one, if it is kept.
    pub(super) fn last_mut(&mut self) -> Option<&mut T> {
        if self.left_off > 0 {
            return None;
        }
        self.first.last_mut()
    }

    /// Those that are kept, and how many are not.
    pub(super) fn end(self) -> (Vec<T>, u64) {
        (self.first, self.left_off)
    }
}

impl<T> Extend<T> for Kept<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, others: I) {
        others.into_iter().for_each(|another| self.push(another));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_are_kept_and_the_others_counted() {
        let mut kept = Kept::default();
        kept.extend(0..MOST);
        assert_eq!(kept.last_mut(), Some(&mut (MOST - 1)));
        kept.extend([7, 8, 9]);
        assert_eq!(kept.last_mut(), None);
        assert_eq!(kept.end(), ((0..MOST).collect(), 3));
    }
}
