//! Spans of time on the command line.

use std::time::Duration;

/// Parses a span such as `90d`, `12h` or `30m`.
pub(crate) fn span(text: &str) -> Result<Duration, String> {
    let wrong = || "a time such as 90d, 12h or 30m".to_owned();
    let unit = text.chars().next_back().ok_or_else(wrong)?;
    let seconds = match unit {
        'd' => 86_400,
        'h' => 3600,
        'm' => 60,
        _ => return Err(wrong()),
    };
    let number = &text[..text.len() - unit.len_utf8()];
    let number: u32 = number.parse().map_err(|_| wrong())?;
    match number {
        0 => Err(wrong()),
        number => Ok(Duration::from_secs(u64::from(number) * seconds)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_has_a_number_and_a_unit() {
        assert_eq!(span("90d"), Ok(Duration::from_secs(90 * 86_400)));
        assert_eq!(span("30m"), Ok(Duration::from_secs(1800)));
        for bad in ["", "d", "0d", "90", "-1d", "1.5h", "9ü"] {
            assert!(span(bad).is_err(), "{bad}");
        }
    }
}
