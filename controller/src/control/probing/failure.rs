//! Why a probing fails, and what to do then.

use syncline_trajectory::path::JogError;

/// Why a probing failed. The axes came to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProbeFailure {
    /// There was contact before it began.
    Closed,
    /// There was no contact to be lost.
    Open,
    /// No contact came on the whole way.
    NoContact,
    /// The contact stayed on the whole way.
    Stuck,
    /// The probe's level is not known.
    NoSignal,
    /// It would go on too far behind the contact.
    TooFast {
        /// How far, mm.
        overtravel: f64,
        /// How far it may, mm.
        allowed: f64,
    },
    /// A drive captured another edge than the one that the samples saw.
    OtherEdge {
        /// Its axis.
        axis: usize,
    },
    /// The axes do not stay within their standstill windows behind the motion.
    NotSettled {
        /// The first that does not.
        axis: usize,
    },
    /// The motion is refused.
    Refused(JogError),
}

impl ProbeFailure {
    /// What happened, and what to do next; `axis` names the one that it is about.
    pub(in crate::control) fn describe(self, axis: impl Fn(usize) -> String) -> String {
        match self {
            Self::Closed => "there is contact before the probing: move away first, and check \
                             `active_low`"
                .into(),
            Self::Open => "there is no contact that could be lost: check the probe's wiring and \
                           `active_low`"
                .into(),
            Self::NoContact => {
                "no contact came on the whole way: check where the work is, and the \
                                probe's wiring; G38.3 goes on without one"
                    .into()
            }
            Self::Stuck => "the contact stayed on the whole way: check whether the probe sticks; \
                            G38.5 goes on with it"
                .into(),
            Self::NoSignal => {
                "the probe's level is not known: check the device that it is wired to".into()
            }
            Self::TooFast {
                overtravel,
                allowed,
            } => format!(
                "the axes would go on for {overtravel:.3} mm behind the contact, {allowed} mm are \
                 allowed: lower F, or raise `overtravel` in [probing] if the probe bears it"
            ),
            Self::OtherEdge { axis: of } => format!(
                "a drive of axis {} captured another place than the one where the contact came: check \
                 whether the probe bounces, and which input it is wired to, or set `latch = false` in [probing]",
                axis(of)
            ),
            Self::NotSettled { axis: of } => format!(
                "axis {} does not settle within its `standstill_window` behind the motion: check what holds it back, \
                 and whether the window is wide enough for it",
                axis(of)
            ),
            Self::Refused(why) => format!("{why}: raise it, or correct where the probing leads"),
        }
    }
}
