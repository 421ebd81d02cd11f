//! Instants as dates and clock times: `2023-03-14T09:26:53.000`, `14.03.2023 09:26:53,5`,
//! `09:26:53.589`.

/// Number of seconds in a day.
const DAY_S: f64 = 86_400.0;

/// Maximum length of the text of an instant, in bytes.
const MAX_BYTES: usize = 48;

/// Instant: the day, counted from 1970-01-01, if there is a date, and the seconds of the day.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Instant {
    pub day: Option<i64>,
    pub seconds: f64,
}

impl Instant {
    /// Reads an instant; `None` for other text, and for plain numbers.
    pub fn parse(field: &[u8]) -> Option<Self> {
        if field.len() > MAX_BYTES || !field.first()?.is_ascii_digit() {
            return None;
        }
        let text = std::str::from_utf8(field).ok()?.trim();
        if !text.contains(':') {
            return Some(Self { day: Some(date(text)?), seconds: 0.0 });
        }
        let (day, clock) =
            match text.split_once(['T', 't', ' ']).filter(|(day, _)| !day.contains(':')) {
                Some((day, clock)) => (Some(date(day)?), clock),
                None => (None, text),
            };
        Some(Self { day, seconds: seconds(clock.trim())? })
    }

    /// Returns the seconds since the beginning of the day `origin`, counted from 1970-01-01.
    pub fn since(self, origin: i64) -> f64 {
        let days = self.day.map_or(0, |day| day - origin);
        days as f64 * DAY_S + self.seconds
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
        // The day comes before the month, except with a slash if only the other order is possible.
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

/// Reads a time of day, in s: `hh:mm`, `hh:mm:ss.fff`, `mm:ss.fff`, with AM or PM; a time zone at
/// the end is ignored.
fn seconds(text: &str) -> Option<f64> {
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
        [h, m, s] => (whole(h)?, whole(m)?, fraction(s)?),
        [m, s] if s.contains(['.', ',']) => (0.0, whole(m)?, fraction(s)?),
        [h, m] => (whole(h)?, whole(m)?, 0.0),
        _ => return None,
    };
    let hours = half.map_or(hours, |half| hours % 12.0 + half);
    (minutes < 60.0 && seconds < 61.0).then_some(3600.0 * hours + 60.0 * minutes + seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Judge: `date -d … +%s` for the days, and the clock by hand.
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
        assert_eq!(Instant { day: Some(11), seconds: 1.0 }.since(10), 86_401.0);
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
