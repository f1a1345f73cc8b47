//! Motion along a line in step with a shaft that something else turns: threads.
//!
//! A thread is a straight stretch of the path on which the tool goes by one lead in each turn of the spindle, from a
//! place where the spindle's angle is a whole number of turns. The spindle is the master: nobody asks it to be even, it
//! is measured once a cycle, and what is sent to the axes takes effect later. So there are two parts:
//!
//! - the [`AngleObserver`] says where the spindle will be at that later instant,
//! - the [`Follower`] makes of it setpoints that keep the limits: it picks the motion up from rest such that it is in
//!   step, goes along, and comes to rest at the thread's end; or has the spindle turned round there, and goes back with it.
//!
//! Nothing here allocates.

mod follower;
mod observer;

pub use follower::{BEYOND, Follower, LEAST_RISE, LostStep, RAMP_PART, Tapping, Thread};
pub use observer::{AngleObserver, RippleLimits, Turning};
