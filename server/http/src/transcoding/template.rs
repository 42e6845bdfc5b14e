//! Paths of HTTP requests with fields of a message in them, as in `google.api.http`: `/v1/{name=jobs/*}:cancel`.

use percent_encoding::percent_decode_str;

/// A path with fields.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Template {
    segments: Vec<Segment>,
    fields: Vec<Field>,
    /// What stands behind the last colon; often empty.
    verb: String,
}

/// What a segment of a path must be.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Segment {
    Literal(String),
    /// `*`: any one.
    One,
    /// `**`: any number from one on.
    Many,
}

/// A field of the request whose value is a part of the path.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Field {
    /// `subject.name`.
    path: String,
    /// Its segments.
    begin: usize,
    end: usize,
}

/// A part of a template, for a description.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Piece<'a> {
    Literal(&'a str),
    /// Some value of a field.
    Value {
        /// Path of the field.
        field: &'a str,
        /// Whether it has slashes.
        many: bool,
    },
}

impl Template {
    /// Reads a template. `None` if it is none, or has two parts of any length.
    pub(super) fn read(text: &str) -> Option<Self> {
        let rest = text.strip_prefix('/')?;
        let (rest, verb) = match rest.rsplit_once(':') {
            Some((path, verb)) if !verb.contains(['/', '}']) => (path, verb),
            _ => (rest, ""),
        };
        let mut found = Self {
            segments: Vec::new(),
            fields: Vec::new(),
            verb: verb.to_owned(),
        };
        let mut open = rest;
        while !open.is_empty() {
            let part = match open.strip_prefix('{') {
                Some(inside) => {
                    let (field, after) = inside.split_once('}')?;
                    let (path, pattern) = field.split_once('=').unwrap_or((field, "*"));
                    let begin = found.segments.len();
                    found.segments.extend(pattern.split('/').map(Segment::of));
                    found.fields.push(Field {
                        path: path.to_owned(),
                        begin,
                        end: found.segments.len(),
                    });
                    after
                }
                None => {
                    let (segment, _) = open.split_once('/').unwrap_or((open, ""));
                    found.segments.push(Segment::of(segment));
                    &open[segment.len()..]
                }
            };
            open = match part.strip_prefix('/') {
                Some(rest) => rest,
                None if part.is_empty() => part,
                None => return None,
            };
        }
        let many = found.segments.iter().filter(|it| **it == Segment::Many);
        (many.count() <= 1).then_some(found)
    }

    /// Values of the fields, if `path` has this form. Segments are decoded one by one, so that one may contain an encoded slash.
    pub(super) fn values(&self, path: &str) -> Option<Vec<(&str, String)>> {
        let path = path.strip_prefix('/')?;
        let path = match self.verb.is_empty() {
            // A colon of a value is encoded.
            true => Some(path).filter(|it| !last(it).contains(':')),
            false => path.strip_suffix(&self.verb)?.strip_suffix(':'),
        }?;
        let found: Vec<&str> = path.split('/').collect();
        // The segments that `**` stands for.
        let more = (found.len() + 1).checked_sub(self.segments.len())?;
        let mut bounds = vec![0];
        let mut at = 0;
        for segment in &self.segments {
            let count = if *segment == Segment::Many { more } else { 1 };
            let those = found.get(at..at + count)?;
            let fits = match segment {
                Segment::Literal(literal) => those == [literal.as_str()],
                _ => !those.is_empty() && those.iter().all(|it| !it.is_empty()),
            };
            if !fits {
                return None;
            }
            at += count;
            bounds.push(at);
        }
        if at != found.len() {
            return None;
        }
        let mut values = Vec::new();
        for field in &self.fields {
            let those = &found[bounds[field.begin]..bounds[field.end]];
            let decoded: Result<Vec<_>, _> = those
                .iter()
                .map(|it| percent_decode_str(it).decode_utf8())
                .collect();
            values.push((field.path.as_str(), decoded.ok()?.join("/")));
        }
        Some(values)
    }

    /// Whether a part of it stands for any number of segments.
    pub(super) fn has_any_length(&self) -> bool {
        self.segments.contains(&Segment::Many)
    }

    /// Paths of the fields.
    pub(super) fn fields(&self) -> impl Iterator<Item = &str> {
        self.fields.iter().map(|it| it.path.as_str())
    }

    /// The parts of the path without its verb.
    pub(super) fn pieces(&self) -> impl Iterator<Item = Piece<'_>> {
        self.segments.iter().enumerate().map(|(at, segment)| {
            let inside = |it: &&Field| (it.begin..it.end).contains(&at);
            let field = self.fields.iter().find(inside);
            match (segment, field) {
                (Segment::Literal(literal), _) => Piece::Literal(literal),
                (segment, field) => Piece::Value {
                    field: field.map_or("", |it| it.path.as_str()),
                    many: *segment == Segment::Many,
                },
            }
        })
    }

    /// What stands behind the colon.
    pub(super) fn verb(&self) -> &str {
        &self.verb
    }
}

impl Segment {
    fn of(text: &str) -> Self {
        match text {
            "*" => Self::One,
            "**" => Self::Many,
            literal => Self::Literal(literal.to_owned()),
        }
    }
}

fn last(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(template: &str, path: &str) -> Option<Vec<String>> {
        let template = Template::read(template).expect("a template");
        let values = template.values(path)?;
        Some(values.into_iter().map(|(_, value)| value).collect())
    }

    fn one(value: &str) -> Option<Vec<String>> {
        Some(vec![value.to_owned()])
    }

    #[test]
    fn fields_are_found_in_paths() {
        assert_eq!(values("/v1/jobs", "/v1/jobs"), Some(vec![]));
        assert_eq!(values("/v1/{name=jobs/*}", "/v1/jobs/7"), one("jobs/7"));
        assert_eq!(
            values("/v1/{name=jobs/*}:cancel", "/v1/jobs/7:cancel"),
            one("jobs/7")
        );
        assert_eq!(
            values(
                "/v1/{parent=**}/objects",
                "/v1/models/a/checkpoints/3/objects"
            ),
            one("models/a/checkpoints/3")
        );
        assert_eq!(
            values(
                "/v1/{name=**}:download",
                "/v1/jobs/a/objects/0.png:download"
            ),
            one("jobs/a/objects/0.png")
        );
        assert_eq!(
            values("/v1/{name=jobs/*}", "/v1/jobs/a%2Fb%3Ac"),
            one("jobs/a/b:c")
        );
    }

    #[test]
    fn other_paths_do_not_fit() {
        for (template, path) in [
            ("/v1/jobs", "/v1/jobs/"),
            ("/v1/jobs", "/v1/jobs:watch"),
            ("/v1/{name=jobs/*}", "/v1/jobs"),
            ("/v1/{name=jobs/*}", "/v1/jobs/"),
            ("/v1/{name=jobs/*}", "/v1/jobs/7:cancel"),
            ("/v1/{name=jobs/*}", "/v1/jobs/7/8"),
            ("/v1/{name=jobs/*}", "/v1/models/7"),
            ("/v1/{name=jobs/*}:cancel", "/v1/jobs/7:retry"),
            ("/v1/{name=jobs/*}:cancel", "/v1/jobs/7"),
            ("/v1/{parent=**}/objects", "/v1/objects"),
            ("/v1/{name=jobs/*}", "/v1/jobs/%FF"),
            ("/v1/{name=jobs/*}", ""),
        ] {
            assert_eq!(values(template, path), None, "{template} {path}");
        }
    }

    #[test]
    fn a_template_with_two_parts_of_any_length_is_none() {
        assert_eq!(Template::read("/v1/{a=**}/{b=**}"), None);
        assert_eq!(Template::read("v1"), None);
        assert_eq!(Template::read("/v1/{a"), None);
    }

    #[test]
    fn pieces_describe_a_path() {
        let template = Template::read("/v1/{subject.name=subjects/*}:x").expect("a template");
        let pieces: Vec<_> = template.pieces().collect();
        let field = "subject.name";
        assert_eq!(
            pieces,
            [
                Piece::Literal("v1"),
                Piece::Literal("subjects"),
                Piece::Value { field, many: false }
            ]
        );
        assert_eq!(template.verb(), "x");
    }
}
