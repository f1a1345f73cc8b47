//! Whether something has been so for a while, as windows and supervision ask.

use syncline_canopen::Instant;
use syncline_canopen::time::Duration;

/// Since when something has been so without a break.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lasting(Option<Instant>);

impl Lasting {
    /// Notes whether it is so now; gives whether it has been so for `time`.
    pub fn for_time(&mut self, time: Duration, now: Instant, is_so: bool) -> bool {
        self.0 = is_so.then(|| self.0.unwrap_or(now));
        self.0
            .is_some_and(|since| now.saturating_since(since) >= time)
    }
}
