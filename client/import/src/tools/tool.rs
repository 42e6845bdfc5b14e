//! The description of a tool, from which all lists of tools are made.

use crate::proof::{Documented, ToolOutput};
use crate::source::{Part, Source};
use crate::{ImportError, Options};

/// A folder below the given one, and the beginning and the ending of a file's name in it.
pub(crate) type Location = (&'static str, &'static str, &'static str);

/// A program that finds the poses of people in a video.
pub(crate) struct Tool {
    /// What `--from` takes.
    pub from: &'static str,
    /// The help of the format.
    pub help: &'static str,
    /// The files by which it is recognised, for errors.
    pub files: &'static str,
    /// Where its files are in the folder that it writes, the surest first.
    pub locations: &'static [Location],
    /// In a folder with files of several tools, those of the smallest rank are taken.
    pub search_rank: u8,
    /// Whether its captures have several cameras, of which `--view` names one.
    pub has_views: bool,
    /// Whether the tool wrote a file with these contents.
    pub fits: fn(&Part<'_>) -> bool,
    pub read: fn(&ToolFile<'_>) -> Result<ToolOutput, ImportError>,
    pub documented: Documented,
}

/// A file that a tool wrote.
pub(crate) struct ToolFile<'a> {
    /// Its contents.
    pub root: &'a Part<'a>,
    /// The folder that the user named.
    pub source: &'a Source,
    /// The file's path in that folder.
    pub name: &'a str,
    pub options: &'a Options,
}
