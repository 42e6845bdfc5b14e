//! The file of settings: TOML, one key for each option.

use std::path::{Path, PathBuf};
use thiserror::Error;
use toml::de::{DeTable, DeValue};

/// Similarity of names, from 0 to 1, from which one may be meant for the other.
const SIMILAR: f64 = 0.7;

/// A value of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FileSetting {
    /// Id of the option.
    pub id: String,
    /// Its name on the command line.
    pub name: String,
    /// As it would be on the command line.
    pub value: String,
    /// Its line, from 1.
    pub line: usize,
}

/// The reason why a file can't be used.
#[derive(Debug, Error)]
pub(super) enum FileError {
    #[error("reading the settings in {}: {source}", path.display())]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}:{line}: {message}", path.display())]
    Syntax {
        path: PathBuf,
        line: usize,
        message: String,
    },
    #[error("{}:{line}: there is no setting {key}{}", path.display(), meant(.nearest))]
    Unknown {
        path: PathBuf,
        line: usize,
        key: String,
        nearest: Option<String>,
    },
    #[error("{}:{line}: {key} takes one value: a text, a number, true or false", path.display())]
    Kind {
        path: PathBuf,
        line: usize,
        key: String,
    },
}

fn meant(nearest: &Option<String>) -> String {
    match nearest {
        Some(name) => format!("; did you mean {name}?"),
        None => "; `yoto serve --print-config` prints all".to_owned(),
    }
}

/// Reads the file at `path`; `settings` are ids and names of options.
pub(super) fn read(
    path: &Path,
    settings: &[(String, String)],
) -> Result<Vec<FileSetting>, FileError> {
    let text = std::fs::read_to_string(path).map_err(|source| FileError::Read {
        path: path.to_owned(),
        source,
    })?;
    entries(path, &text, settings)
}

fn entries(
    path: &Path,
    text: &str,
    settings: &[(String, String)],
) -> Result<Vec<FileSetting>, FileError> {
    let line_at = |at: usize| {
        1 + text.as_bytes()[..at]
            .iter()
            .filter(|it| **it == b'\n')
            .count()
    };
    let table = DeTable::parse(text).map_err(|error| FileError::Syntax {
        path: path.to_owned(),
        line: line_at(error.span().map_or(0, |span| span.start)),
        message: error.message().to_owned(),
    })?;
    let mut entries = Vec::new();
    for (key, value) in table.get_ref() {
        let line = line_at(key.span().start);
        let name = key.get_ref().as_ref();
        let known = settings.iter().find(|(_, known)| known == name);
        let Some((id, _)) = known else {
            return Err(FileError::Unknown {
                path: path.to_owned(),
                line,
                key: name.to_owned(),
                nearest: nearest(name, settings),
            });
        };
        let value = match value.get_ref() {
            DeValue::String(text) => text.to_string(),
            DeValue::Integer(number) => number.to_string(),
            DeValue::Float(number) => number.to_string(),
            DeValue::Boolean(flag) => flag.to_string(),
            _ => {
                return Err(FileError::Kind {
                    path: path.to_owned(),
                    line,
                    key: name.to_owned(),
                });
            }
        };
        entries.push(FileSetting {
            id: id.clone(),
            name: name.to_owned(),
            value,
            line,
        });
    }
    entries.sort_by_key(|it| it.line);
    Ok(entries)
}

/// The setting whose name is most like `name`, if one is.
fn nearest(name: &str, settings: &[(String, String)]) -> Option<String> {
    let name = name.replace('_', "-");
    let like = settings.iter().map(|(_, known)| {
        let similarity = strsim::jaro_winkler(&name, known);
        (similarity, known)
    });
    let best = like.max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(similarity, _)| *similarity >= SIMILAR)
        .map(|(_, known)| known.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<FileSetting>, String> {
        let settings = ["listen", "keep-newest", "no-worker"].map(|name| {
            let id = name.replace('-', "_");
            (id, name.to_owned())
        });
        entries(Path::new("y.toml"), text, &settings).map_err(|error| error.to_string())
    }

    #[test]
    fn values_are_those_of_the_command_line() {
        let text = "# a comment\nlisten = \"a:1\"\n\nkeep-newest = 5\nno-worker = true\n";
        let found = read(text).expect("reads");
        let found: Vec<_> = found
            .iter()
            .map(|it| (&*it.id, &*it.value, it.line))
            .collect();
        let expected = [
            ("listen", "a:1", 2),
            ("keep_newest", "5", 4),
            ("no_worker", "true", 5),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn a_fault_is_named_with_its_line() {
        let told = |text: &str| read(text).expect_err("is refused");
        let unknown = told("\nlisten = \"a:1\"\nkeep_newest = 3");
        let expected = "y.toml:3: there is no setting keep_newest; did you mean keep-newest?";
        assert_eq!(unknown, expected);
        assert!(told("colour = 1").ends_with("prints all"));
        assert!(told("listen = [\"a:1\"]").starts_with("y.toml:1: listen takes one value"));
        assert!(told("listen = \"a:1\"\n[traffic]\n").starts_with("y.toml:2: there is no"));
        assert!(told("\nlisten = \n").starts_with("y.toml:2: "));
    }
}
