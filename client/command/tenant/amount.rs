//! Numbers of quotas: with units, as people write them.

use std::fmt;
use std::str::FromStr;

/// Units of bytes, the largest first.
const BYTES: [(&str, u64); 4] = [
    ("T", 1 << 40),
    ("G", 1 << 30),
    ("M", 1 << 20),
    ("K", 1 << 10),
];

/// A number of a quota, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Limit<T> {
    /// No limit.
    None,
    /// At most this.
    Is(T),
}

impl<T> Limit<T> {
    /// The field of a quota.
    pub(super) fn field(self) -> Option<T> {
        match self {
            Self::None => None,
            Self::Is(most) => Some(most),
        }
    }
}

/// `none`, or a whole number.
pub(super) fn count(text: &str) -> Result<Limit<u64>, String> {
    read(text, |text| {
        u64::from_str(text).map_err(|_| format!("`{text}` is neither a whole number nor `none`"))
    })
}

/// `none`, or bytes: a whole number, or one with K, M, G or T.
pub(super) fn bytes(text: &str) -> Result<Limit<u64>, String> {
    let bytes = |text: &str| {
        let unit = BYTES.iter().find(|(name, _)| text.ends_with(name));
        let (number, unit) = unit.map_or((text, 1), |(name, unit)| {
            (text.trim_end_matches(name), *unit)
        });
        let number = u64::from_str(number)
            .ok()
            .and_then(|it| it.checked_mul(unit));
        number.ok_or_else(|| format!("`{text}` is neither bytes, as 500G or 2T, nor `none`"))
    };
    read(text, bytes)
}

/// `none`, or hours.
pub(super) fn hours(text: &str) -> Result<Limit<f64>, String> {
    let hours = |text: &str| {
        let number = f64::from_str(text)
            .ok()
            .filter(|it| it.is_finite() && *it >= 0.0);
        number.ok_or_else(|| format!("`{text}` is neither a number of hours nor `none`"))
    };
    read(text, hours)
}

/// `none`, or calls per second.
pub(super) fn calls(text: &str) -> Result<Limit<f64>, String> {
    let calls = |text: &str| {
        let number = f64::from_str(text).ok();
        let number = number.filter(|it| it.is_finite() && *it >= 0.0);
        number.ok_or_else(|| format!("`{text}` is neither a number of calls per second nor `none`"))
    };
    read(text, calls)
}

fn read<T>(text: &str, parse: impl Fn(&str) -> Result<T, String>) -> Result<Limit<T>, String> {
    match text {
        "none" => Ok(Limit::None),
        text => parse(text).map(Limit::Is),
    }
}

/// Bytes in the largest unit of which there is one.
pub(super) struct Bytes(pub(super) u64);

impl fmt::Display for Bytes {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match BYTES.iter().find(|(_, unit)| self.0 >= *unit) {
            Some((name, unit)) => write!(out, "{:.1} {name}iB", self.0 as f64 / *unit as f64),
            None => write!(out, "{} B", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_units_or_are_none() {
        assert_eq!(count("12"), Ok(Limit::Is(12)));
        assert_eq!(count("none"), Ok(Limit::None));
        assert_eq!(bytes("3"), Ok(Limit::Is(3)));
        assert_eq!(bytes("2G"), Ok(Limit::Is(2 << 30)));
        assert_eq!(hours("1.5"), Ok(Limit::Is(1.5)));
        for bad in ["", "-1", "1.5", "G", "GG", "99999999T", "1g"] {
            assert!(bytes(bad).is_err(), "{bad}");
            assert!(count(bad).is_err(), "{bad}");
        }
        for bad in ["", "-1", "inf", "NaN", "1h"] {
            assert!(hours(bad).is_err(), "{bad}");
        }
        assert_eq!(Bytes(3 << 29).to_string(), "1.5 GiB");
        assert_eq!(Bytes(17).to_string(), "17 B");
    }
}
