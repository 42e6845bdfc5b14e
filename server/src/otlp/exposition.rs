//! Reads the text of `/metrics`: the registry of figures gives its content in no other form.

use thiserror::Error;

/// A line that is not valid OpenMetrics, as this program writes it.
#[derive(Debug, Error)]
#[error("line {number} of the figures can't be read: {line}")]
pub struct Unreadable {
    number: usize,
    line: String,
}

/// What a family of figures measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Counts what happened since the process began.
    Counter,
    /// What is now.
    Gauge,
    /// Counts values by their size.
    Histogram,
}

/// Figures of one name.
#[derive(Debug, PartialEq)]
pub struct Family {
    /// Its name, with the unit and without `_total`.
    pub name: String,
    /// What it measures.
    pub kind: Kind,
    /// In words.
    pub help: String,
    /// Such as `seconds`; empty: none.
    pub unit: String,
    /// Its values.
    pub samples: Vec<Sample>,
}

/// One value.
#[derive(Debug, PartialEq)]
pub struct Sample {
    /// What follows the family's name, such as `_total`.
    pub suffix: String,
    /// Labels and their values.
    pub labels: Vec<(String, String)>,
    /// The value.
    pub value: Value,
}

/// A number as it was written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// Without a point.
    Whole(i64),
    /// Any other.
    Real(f64),
}

impl Value {
    /// As a count.
    pub fn count(self) -> u64 {
        match self {
            Self::Whole(value) => u64::try_from(value).unwrap_or(0),
            Self::Real(value) => value as u64,
        }
    }

    /// As a real number.
    pub fn real(self) -> f64 {
        match self {
            Self::Whole(value) => value as f64,
            Self::Real(value) => value,
        }
    }
}

/// The families of `text`, in its order.
///
/// # Errors
/// With the first line that can't be read.
pub fn families(text: &str) -> Result<Vec<Family>, Unreadable> {
    let mut families = Vec::new();
    for (i, line) in text.lines().enumerate() {
        read(line, &mut families).ok_or_else(|| Unreadable {
            number: i + 1,
            line: line.to_owned(),
        })?;
    }
    Ok(families)
}

/// Adds a line to the families. `None` if it can't be read.
fn read(line: &str, families: &mut Vec<Family>) -> Option<()> {
    let Some(told) = line.strip_prefix("# ") else {
        let family = families.last_mut()?;
        let sample = sample(line.strip_prefix(&family.name)?)?;
        family.samples.push(sample);
        return Some(());
    };
    if told == "EOF" {
        return Some(());
    }
    let mut words = told.splitn(3, ' ');
    let (what, name, rest) = (words.next()?, words.next()?, words.next()?);
    match what {
        // The first line of each family.
        "HELP" => families.push(Family {
            name: name.to_owned(),
            kind: Kind::Gauge,
            help: unescaped(rest),
            unit: String::new(),
            samples: Vec::new(),
        }),
        "TYPE" => {
            families.last_mut()?.kind = match rest {
                "counter" => Kind::Counter,
                "gauge" => Kind::Gauge,
                "histogram" => Kind::Histogram,
                _ => return None,
            }
        }
        "UNIT" => families.last_mut()?.unit = rest.to_owned(),
        _ => return None,
    }
    Some(())
}

/// A sample after its family's name.
fn sample(line: &str) -> Option<Sample> {
    let end = line.find(['{', ' '])?;
    let (suffix, mut rest) = line.split_at(end);
    let mut labels = Vec::new();
    if let Some(inside) = rest.strip_prefix('{') {
        rest = inside;
        while !rest.starts_with('}') {
            let (name, after) = rest.split_once("=\"")?;
            let end = closing(after)?;
            let value = unescaped(&after[..end]);
            labels.push((name.trim_start_matches(',').to_owned(), value));
            rest = &after[end + 1..];
        }
        rest = &rest[1..];
    }
    // An exemplar or a time may follow.
    let value = rest.trim_start().split(' ').next()?;
    let value = match value.parse() {
        Ok(whole) => Value::Whole(whole),
        Err(_) => Value::Real(value.parse().ok()?),
    };
    Some(Sample {
        suffix: suffix.to_owned(),
        labels,
        value,
    })
}

/// Where the quoted text ends that begins `text`.
fn closing(text: &str) -> Option<usize> {
    let mut escaped = false;
    text.find(|it| {
        let ends = it == '"' && !escaped;
        escaped = it == '\\' && !escaped;
        ends
    })
}

/// The text without its escapes.
fn unescaped(text: &str) -> String {
    let mut found = String::with_capacity(text.len());
    let mut letters = text.chars();
    while let Some(letter) = letters.next() {
        found.push(match letter {
            '\\' => match letters.next() {
                Some('n') => '\n',
                Some(other) => other,
                None => '\\',
            },
            other => other,
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use prometheus_client::encoding::text::encode;
    use prometheus_client::metrics::counter::Counter;
    use prometheus_client::metrics::family::Family as Registered;
    use prometheus_client::metrics::histogram::Histogram;
    use prometheus_client::registry::{Registry, Unit};

    #[test]
    fn what_the_registry_writes_is_read() {
        let mut registry = Registry::with_prefix("yoto");
        let calls = Registered::<Vec<(String, String)>, Counter>::default();
        let odd = r#"a "b", \n} c=""#;
        let labels = vec![("kind".to_owned(), odd.to_owned()), ("x".into(), "".into())];
        calls.get_or_create(&labels).inc_by(3);
        registry.register("calls", "Calls", calls);
        let took = Histogram::new([0.5, 1.0]);
        took.observe(0.75);
        registry.register_with_unit("took", "Time", Unit::Seconds, took);
        let mut text = String::new();
        encode(&mut text, &registry).expect("writes");

        let found = families(&text).expect("reads");
        assert_eq!(
            (&*found[0].name, found[0].kind),
            ("yoto_calls", Kind::Counter)
        );
        let sample = Sample {
            suffix: "_total".into(),
            labels,
            value: Value::Whole(3),
        };
        assert_eq!(found[0].samples, [sample]);
        let took = &found[1];
        assert_eq!(
            (&*took.name, took.kind),
            ("yoto_took_seconds", Kind::Histogram)
        );
        assert_eq!((&*took.unit, &*took.help), ("seconds", "Time."));
        let figures = took.samples.iter().map(|it| {
            let bound = it.labels.iter().map(|(_, value)| value.as_str()).collect();
            (it.suffix.as_str(), bound, it.value.real())
        });
        let figures: Vec<(&str, String, f64)> = figures.collect();
        let expected = [
            ("_sum", "", 0.75),
            ("_count", "", 1.0),
            ("_bucket", "0.5", 0.0),
            ("_bucket", "1.0", 1.0),
            ("_bucket", "+Inf", 1.0),
        ];
        assert_eq!(figures, expected.map(|(a, b, c)| (a, b.to_owned(), c)));
    }

    #[test]
    fn an_invalid_line_is_named() {
        for bad in [
            "alone 1",
            "# HELP a b\na",
            "# HELP a b\na{x=\"} 1",
            "# HELP a b\na one",
            "# HELP a b\n# TYPE a summary",
        ] {
            families(bad).expect_err(bad);
        }
        let error = families("# HELP a b\nb 1").expect_err("is another's");
        assert_eq!(
            error.to_string(),
            "line 2 of the figures can't be read: b 1"
        );
    }
}
