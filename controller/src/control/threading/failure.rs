//! Why a thread fails, and what to do then.

use syncline_trajectory::synchronous::LostStep;

/// Why a thread failed. The axes came to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThreadFailure {
    /// The spindle did not turn as it was told to.
    NotTurning,
    /// The axes could not stay in step.
    LostStep(LostStep),
}

impl ThreadFailure {
    /// What happened, and what to do next.
    pub(in crate::control) fn describe(self) -> String {
        match self {
            Self::NotTurning => {
                "the spindle does not turn as it is told to, or not evenly: look at its \
                                 drive, and for what holds it back"
                    .to_owned()
            }
            Self::LostStep(LostStep::TooFast { wanted, allowed }) => format!(
                "the spindle is too fast for the axes: it asks for {wanted:.2} mm/s along the thread, \
                 they go {allowed:.2} mm/s at most: lower S"
            ),
            Self::LostStep(LostStep::TooDeep) => {
                "the spindle was told to turn round, and does not stand where the thread ends: look at its drive, and \
                 whether `ramp_ms` in [spindle] is what it can"
                    .to_owned()
            }
            Self::LostStep(LostStep::Behind { distance }) => format!(
                "the axes cannot follow the spindle, they are {distance:.3} mm away from where it \
                 wants them: look for what makes its speed change, or lower S"
            ),
        }
    }
}
