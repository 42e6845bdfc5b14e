//! What there is to know of each tool.

use crate::Options;
use crate::proof::{Documented, Found};
use crate::source::{Part, Source};
use yoto_client::ClientError;

/// A program that finds the poses of people in a video.
pub(crate) struct Tool {
    /// The files by which it is recognised, for errors.
    pub files: &'static str,
    /// Whether the tool wrote a file with these contents.
    pub fits: fn(&Part<'_>) -> bool,
    pub read: fn(&ToolFile<'_>) -> Result<Found, ClientError>,
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
