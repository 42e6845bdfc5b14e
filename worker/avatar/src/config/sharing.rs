//! Sharing of a hash grid between people, and its text form: `own`, `split:11`, `bases:4`.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Which entries of a hash grid people share. Networks are always shared. With the variant
/// [`super::Variant::NoIdentity`], people share the whole grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Sharing {
    /// No sharing: one table per identity.
    #[default]
    Own,
    /// A shared table and a smaller one per identity, whose features are added.
    Split {
        /// Binary logarithm of the rows of the largest level of an identity's table.
        own_log2_rows: u32,
    },
    /// Each entry holds several rows, which an identity combines linearly with its own
    /// coefficients, one set per level.
    Bases {
        /// Rows per entry; times `features` at most 16.
        count: usize,
    },
}

impl fmt::Display for Sharing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Own => f.write_str("own"),
            Self::Split { own_log2_rows } => write!(f, "split:{own_log2_rows}"),
            Self::Bases { count } => write!(f, "bases:{count}"),
        }
    }
}

impl FromStr for Sharing {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let unknown =
            || format!("'{text}' is none of: own, split:ROWS (2 to this power), bases:COUNT");
        let (kind, number) = text.split_once(':').unwrap_or((text, ""));
        match (kind, number.parse::<u32>()) {
            ("own", Err(_)) if number.is_empty() => Ok(Self::Own),
            ("split", Ok(own_log2_rows)) => Ok(Self::Split { own_log2_rows }),
            ("bases", Ok(count)) => Ok(Self::Bases {
                count: count as usize,
            }),
            _ => Err(unknown()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        for sharing in [
            Sharing::Own,
            Sharing::Split { own_log2_rows: 11 },
            Sharing::Bases { count: 4 },
        ] {
            assert_eq!(sharing.to_string().parse(), Ok(sharing));
        }
        for text in ["", "all", "own:3", "split", "split:", "split:x", "bases:-1"] {
            let error = text.parse::<Sharing>().expect_err(text);
            assert!(error.contains("split:ROWS"), "{error}");
        }
    }
}
