//! What people share of a hash grid, and how to write it: `own`, `split:11`, `bases:4`.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// What of a hash grid is everybody's and what is an identity's own. The networks behind it are
/// everybody's always. With the variant [`super::Variant::NoIdentity`], all of it is everybody's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Sharing {
    /// Nothing is shared: a table an identity.
    #[default]
    Own,
    /// Everybody's table and a smaller one an identity, whose features are added.
    Split {
        /// Largest level of an identity's table has 2 to this many rows.
        own_log2_rows: u32,
    },
    /// Each entry holds several rows, which an identity mixes by coefficients of its own, a set a
    /// level.
    Bases {
        /// Rows an entry; times `features` at most 16.
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
