//! Instants as dates and clock times: `2023-03-14T09:26:53.000`, `14.03.2023 09:26:53,5`,
//! `09:26:53.589`.

/// Number of seconds in a day.
const DAY_S: f64 = 86_400.0;

/// Number of seconds in an hour.
const HOUR_S: f64 = 3600.0;

/// Maximum length of the text of an instant, in bytes.
const MAX_BYTES: usize = 48;

/// Instant: the day, counted from 1970-01-01, if there is a date, and the seconds of the day, or of
/// the hour if the clock has no hours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Instant {
    pub day: Option<i64>,
    pub seconds: f64,
    /// `true` if the clock has hours.
    pub has_hours: bool,
}

impl Instant {
    /// Reads an instant; `None` for other text, and for plain numbers.
    pub fn parse(field: &[u8]) -> Option<Self> {
        if field.len() > MAX_BYTES || !field.first()?.is_ascii_digit() {
            return None;
        }
        let text = std::str::from_utf8(field).ok()?.trim();
        if !text.contains(':') {
            return Some(Self { day: Some(date(text)?), seconds: 0.0, has_hours: true });
        }
        let (day, clock) =
            match text.split_once(['T', 't', ' ']).filter(|(day, _)| !day.contains(':')) {
                Some((day, clock)) => (Some(date(day)?), clock),
                None => (None, text),
            };
        let (seconds, has_hours) = seconds(clock.trim())?;
        Some(Self { day, seconds, has_hours })
    }

    /// Returns the clock of a column that begins with this instant; `None` if it has a date.
    pub fn clock(self) -> Option<Clock> {
        let period_s = if self.has_hours { DAY_S } else { HOUR_S };
        self.day.is_none().then_some(Clock { period_s, last_s: self.seconds, passed_s: 0.0 })
    }

    /// Returns the seconds since the beginning of the day `origin`, counted from 1970-01-01.
    pub fn since(self, origin: i64) -> f64 {
        let days = self.day.map_or(0, |day| day - origin);
        days as f64 * DAY_S + self.seconds
    }
}

/// Clock without a date, which begins again after a day or an hour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    /// Time after which the clock begins again, in s.
    period_s: f64,
    /// Time of the clock at the previous instant, in s.
    last_s: f64,
    /// Sum of the days or hours that have passed, in s.
    passed_s: f64,
}

impl Clock {
    /// Returns the seconds since the beginning of the first day or hour. If the time goes back by
    /// more than half a day (or half an hour), the clock has begun again; a second record in the
    /// same file seldom causes such a step.
    pub fn continued(&mut self, seconds: f64) -> f64 {
        if self.last_s - seconds > 0.5 * self.period_s {
            self.passed_s += self.period_s;
        }
        self.last_s = seconds;
        self.passed_s + seconds
    }
}

/// Reads a date, with the year first or last, and returns its day counted from 1970-01-01.
fn date(text: &str) -> Option<i64> {
    let separator = ['-', '/', '.'].into_iter().find(|sign| text.contains(*sign))?;
    let mut parts = text.split(separator).map(|part| (part.len(), part.parse::<i64>().ok()));
    let (first, second, third) = (parts.next()?, parts.next()?, parts.next()?);
    if parts.next().is_some() {
        return None;
    }
    let (year, month, day) = match (first, second, third) {
        ((4, Some(year)), (1 | 2, Some(month)), (1 | 2, Some(day))) => (year, month, day),
        // With a slash, the first number is the month if it is at most 12. In all other cases it is
        // the day.
        ((1 | 2, Some(a)), (1 | 2, Some(b)), (4, Some(year))) => {
            let month_first = separator == '/' && a <= 12;
            if month_first { (year, a, b) } else { (year, b, a) }
        }
        _ => return None,
    };
    let possible = (1..=12).contains(&month) && (1..=31).contains(&day);
    possible.then(|| day_number(year, month, day))
}

/// Returns the number of a day of the Gregorian calendar, counted from 1970-01-01.
///
/// # Source
/// E. Hinnant, *chrono-Compatible Low-Level Date Algorithms*, `days_from_civil`.
fn day_number(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468
}

/// Reads a time of day, in s, and whether it has hours: `hh:mm`, `hh:mm:ss.fff`, `mm:ss.fff`, with
/// AM or PM; a time zone at the end is ignored.
fn seconds(text: &str) -> Option<(f64, bool)> {
    let lower = text.to_lowercase();
    let (text, half) = match (lower.strip_suffix("am"), lower.strip_suffix("pm")) {
        (Some(text), _) => (text.trim_end(), Some(0.0)),
        (_, Some(text)) => (text.trim_end(), Some(12.0)),
        _ => (lower.as_str(), None),
    };
    let text = text.strip_suffix('z').or_else(|| text.strip_suffix(" utc")).unwrap_or(text);
    let text = text.find(['+', '-']).map_or(text, |zone| &text[..zone]);
    let parts: Vec<&str> = text.trim_end().split(':').collect();
    let whole = |part: &str| {
        let is_number = (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
        is_number.then(|| part.parse::<f64>().ok()).flatten()
    };
    let fraction = |part: &str| {
        let digits = part.find(['.', ',']).unwrap_or(part.len());
        whole(&part[..digits])?;
        let is_number = part.bytes().all(|b| b.is_ascii_digit() || b == b'.' || b == b',');
        is_number.then(|| part.replace(',', ".").parse::<f64>().ok()).flatten()
    };
    let (hours, minutes, seconds) = match parts[..] {
        [h, m, s] => (Some(whole(h)?), whole(m)?, fraction(s)?),
        [m, s] if s.contains(['.', ',']) => (None, whole(m)?, fraction(s)?),
        [h, m] => (Some(whole(h)?), whole(m)?, 0.0),
        _ => return None,
    };
    let (has_hours, hours) = (hours.is_some() || half.is_some(), hours.unwrap_or(0.0));
    let hours = half.map_or(hours, |half| hours % 12.0 + half);
    let is_possible = minutes < 60.0 && seconds < 61.0;
    is_possible.then_some((HOUR_S * hours + 60.0 * minutes + seconds, has_hours))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dates and clock times are read as days and seconds. References: `date -d … +%s` for the
    /// days, and hand calculation for the times of day.
    #[test]
    fn instants_of_dates_and_clocks_are_read() {
        for (text, day, seconds) in [
            ("2023-03-14T09:26:53.000", Some(19_430), 34_013.0),
            ("2023-03-14 09:26:53.589Z", Some(19_430), 34_013.589),
            ("2023-03-14T09:26:53+01:00", Some(19_430), 34_013.0),
            ("2024-02-29", Some(19_782), 0.0),
            ("14.03.2023 09:26:53,5", Some(19_430), 34_013.5),
            ("3/14/2023 9:26:53 PM", Some(19_430), 77_213.0),
            ("14/03/2023 09:26", Some(19_430), 33_960.0),
            ("00:00:01.25", None, 1.25),
            ("26:53.5", None, 1613.5),
            ("12:00:00 AM", None, 0.0),
        ] {
            let instant = Instant::parse(text.as_bytes()).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(instant.day, day, "{text}");
            assert!((instant.seconds - seconds).abs() < 1e-9, "{text}");
        }
        assert_eq!(Instant { day: Some(11), seconds: 1.0, has_hours: true }.since(10), 86_401.0);
        for text in [
            "",
            "1.5",
            "1e-3",
            "12",
            "time",
            "1:2:3:4",
            "a:b",
            "12:99:00",
            "2023-13-01",
            "1/2",
            "1.2.3",
        ] {
            assert_eq!(Instant::parse(text.as_bytes()), None, "{text}");
        }
    }
}
