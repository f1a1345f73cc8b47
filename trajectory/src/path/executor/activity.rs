//! What the executor is doing.
//!
//! | from | by | to |
//! |---|---|---|
//! | following, retracing | feed hold | stopping, then holding |
//! | following | retrace | stopping, then retracing |
//! | retracing | resume | stopping, then following |
//! | stopping | another order of these | stopping for that, or on at once where it moves that way |
//! | holding | resume, retrace | following, retracing |
//! | any of them, at rest | jog | jogging, for as long as orders come |
//! | jogging | resume, retrace | jogging back to the path, then following, retracing; with a retraction by one leg of the way, then jogging again |
//! | any | stop | stopping, then ended; off the path they end where they stop |
//!
//! What is at rest already does not stop, and what stops is in motion: with the last of it `Stopping` gives
//! way to what it was for. Every question that is asked of an activity is a predicate here. That the path
//! rests at a mark, in a dwell, at the end of a single block or for want of speed is a matter of the
//! plan ([`Step`](super::Step)), not of what the executor is doing.

use crate::path::ReplanGoal;
use crate::path::jog::Jogging;

/// What the executor is doing.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::large_enum_variant)] // the cycle allocates nothing, so there is no other place for the axes
pub(super) enum Activity<const N: usize> {
    /// Goes on along the path, as far as it is planned.
    Following,
    /// Goes back along the path to the beginning of a block, and rests there until resumed.
    Retracing {
        /// Which request that was: the revision of the plan that was asked for with it.
        asked: u64,
    },
    /// Comes to rest on the path as soon as the limits allow. Only what moves is stopping.
    Stopping {
        /// How far the search for the shortest stop has come.
        search: StopSearch,
        /// What it comes to rest for.
        next: Next,
    },
    /// Rests on the path until resumed.
    Holding,
    /// The axes are off the path, where they are moved one by one.
    Jogging {
        /// What they do there.
        axes: Jogging<N>,
        /// [`Next::Hold`] while they follow orders; otherwise what they go back to the path for, or
        /// that they come to rest where they are, for good.
        next: Next,
    },
    /// Rests for good.
    Ended,
}

/// What comes after a rest on the path, or after the return to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    /// As [`Activity::Following`].
    Follow,
    /// As [`Activity::Retracing`].
    Retrace { asked: u64 },
    /// As [`Activity::Holding`].
    Hold,
    /// As [`Activity::Ended`].
    End,
}

/// How far the search for the shortest stop has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StopSearch {
    /// The plan, which ends at rest, is followed until a shorter stop is found.
    Sought {
        /// The cycle from which on it is searched for.
        departure: u64,
        /// The cycle in which the stop was asked for.
        since: u64,
    },
    /// It is being followed.
    Found,
}

impl<const N: usize> From<Next> for Activity<N> {
    fn from(next: Next) -> Self {
        match next {
            Next::Follow => Activity::Following,
            Next::Retrace { asked } => Activity::Retracing { asked },
            Next::Hold => Activity::Holding,
            Next::End => Activity::Ended,
        }
    }
}

impl<const N: usize> Activity<N> {
    /// It rests, or comes to rest, for good.
    pub(super) fn ends(&self) -> bool {
        matches!(
            self,
            Activity::Ended
                | Activity::Stopping {
                    next: Next::End,
                    ..
                }
                | Activity::Jogging {
                    next: Next::End,
                    ..
                }
        )
    }

    /// It rests, or comes to rest, until an operator lets it go on.
    pub(super) fn holds(&self) -> bool {
        matches!(
            self,
            Activity::Holding
                | Activity::Stopping {
                    next: Next::Hold,
                    ..
                }
                | Activity::Jogging {
                    next: Next::Hold,
                    ..
                }
        )
    }

    /// It goes back along the path, or is about to.
    pub(super) fn retraces(&self) -> bool {
        matches!(
            self,
            Activity::Retracing { .. }
                | Activity::Stopping {
                    next: Next::Retrace { .. },
                    ..
                }
                | Activity::Jogging {
                    next: Next::Retrace { .. },
                    ..
                }
        )
    }

    /// The axes are on their way back to the path.
    pub(super) fn returns(&self) -> bool {
        matches!(
            self,
            Activity::Jogging {
                next: Next::Follow | Next::Retrace { .. },
                ..
            }
        )
    }

    /// A plan gets it on: it follows the path in one direction or the other.
    pub(super) fn takes_plans(&self) -> bool {
        matches!(self, Activity::Following | Activity::Retracing { .. })
    }

    /// It is to come to rest as soon as it can, and the shortest stop was not found yet.
    pub(super) fn seeks_stop(&self) -> bool {
        matches!(
            self,
            Activity::Stopping {
                search: StopSearch::Sought { .. },
                ..
            }
        )
    }

    /// What is wanted of a new plan; nothing where none is taken.
    pub(super) fn goal(&self) -> Option<ReplanGoal> {
        match *self {
            Activity::Following => Some(ReplanGoal::Ahead),
            Activity::Retracing { asked } => Some(ReplanGoal::Retrace { asked }),
            Activity::Stopping {
                search: StopSearch::Sought { .. },
                ..
            } => Some(ReplanGoal::Rest),
            _ => None,
        }
    }

    /// What is done with the axes off the path.
    pub(super) fn jogging(&self) -> Option<&Jogging<N>> {
        match self {
            Activity::Jogging { axes, .. } => Some(axes),
            _ => None,
        }
    }
}
