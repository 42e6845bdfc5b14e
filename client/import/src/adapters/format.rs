//! The names of formats.

use super::table::{adapters, of};
use crate::tools;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::sync::LazyLock;

/// Format of a capture, by the name that `--from` takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format(&'static str);

impl Format {
    /// Recognised by the files.
    pub const AUTO: Self = Self("auto");
    /// This project's own capture folder.
    pub const FOLDER: Self = Self("folder");
    /// A video, or a folder of pictures, alone.
    pub const FILM: Self = Self("film");

    /// The format called `name`.
    pub fn named(name: &str) -> Option<Self> {
        let all = Self::value_variants().iter().copied();
        all.into_iter().find(|format| format.0 == name)
    }

    /// What `--from` takes.
    pub const fn name(self) -> &'static str {
        self.0
    }
}

impl Default for Format {
    fn default() -> Self {
        Self::AUTO
    }
}

impl ValueEnum for Format {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<Format>> = LazyLock::new(|| {
            let named = adapters().iter().map(|adapter| Format(adapter.from));
            [Format::AUTO].into_iter().chain(named).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = of(*self).map_or("Recognised by the files", |adapter| adapter.help);
        Some(PossibleValue::new(self.0).help(help))
    }
}

/// All pose tools: the format of each, and its name in notes.
pub fn pose_tools() -> impl Iterator<Item = (Format, &'static str)> {
    let tools = tools::ALL.into_iter();
    tools.map(|tool| (Format(tool.from), tool.documented.tool))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_found() {
        let all = Format::value_variants();
        let names: BTreeSet<&str> = all.iter().map(|format| format.name()).collect();
        assert_eq!(names.len(), all.len(), "{all:?}");
        for format in all {
            assert_eq!(Format::named(format.name()), Some(*format));
        }
        for format in [Format::AUTO, Format::FOLDER, Format::FILM] {
            assert_eq!(Format::named(format.name()), Some(format));
        }
        assert_eq!(Format::named("motion"), None);
    }
}
