//! Dates of the calendar.

use std::time::{SystemTime, UNIX_EPOCH};

/// An instant in UTC, to the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Utc {
    pub(super) year: u64,
    /// From 1 on, as the day is.
    pub(super) month: u64,
    pub(super) day: u64,
    pub(super) hour: u64,
    pub(super) minute: u64,
    pub(super) second: u64,
}

impl Utc {
    /// Of an instant since 1970.
    pub(super) fn of(instant: SystemTime) -> Self {
        let since_1970 = instant.duration_since(UNIX_EPOCH).unwrap_or_default();
        let seconds = since_1970.as_secs();
        let mut days = seconds / (24 * 3600);
        let is_leap = |year: u64| {
            year.is_multiple_of(4) && !year.is_multiple_of(100) || year.is_multiple_of(400)
        };
        let mut year = 1970;
        while days >= 365 + u64::from(is_leap(year)) {
            days -= 365 + u64::from(is_leap(year));
            year += 1;
        }
        let february = 28 + u64::from(is_leap(year));
        let mut month = 1;
        for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
            if days < length {
                break;
            }
            days -= length;
            month += 1;
        }
        Self {
            year,
            month,
            day: days + 1,
            hour: seconds / 3600 % 24,
            minute: seconds / 60 % 60,
            second: seconds % 60,
        }
    }

    /// As RFC 3339 writes it.
    pub(super) fn rfc_3339(&self) -> String {
        let Self {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = self;
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
    }

    /// As CiA 306 writes it: month, day and year, and the time on a clock of 12 hours.
    pub(super) fn cia_306(&self) -> (String, String) {
        let half = if self.hour < 12 { "AM" } else { "PM" };
        (
            format!("{:02}-{:02}-{}", self.month, self.day, self.year),
            format!("{:02}:{:02}{half}", (self.hour + 11) % 12 + 1, self.minute),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, date, time, rfc_3339) in [
            (0, "01-01-1970", "12:00AM", "1970-01-01T00:00:00Z"),
            (951_782_400, "02-29-2000", "12:00AM", "2000-02-29T00:00:00Z"),
            (951_868_799, "02-29-2000", "11:59PM", "2000-02-29T23:59:59Z"),
            (
                1_735_689_599,
                "12-31-2024",
                "11:59PM",
                "2024-12-31T23:59:59Z",
            ),
            (
                1_740_829_500,
                "03-01-2025",
                "11:45AM",
                "2025-03-01T11:45:00Z",
            ),
            (
                4_107_542_400,
                "03-01-2100",
                "12:00AM",
                "2100-03-01T00:00:00Z",
            ),
        ] {
            let utc = Utc::of(UNIX_EPOCH + Duration::from_secs(seconds));
            assert_eq!(utc.cia_306(), (date.into(), time.into()));
            assert_eq!(utc.rfc_3339(), rfc_3339);
        }
    }
}
