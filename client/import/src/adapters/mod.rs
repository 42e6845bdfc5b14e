//! The formats that are imported. One table ([`table`]) serves the readers, recognition ([`mod@recognise`]), the check of
//! options ([`unread`]) and the help ([`help`]).

mod flags;
mod format;
mod help;
mod recognise;
mod table;
mod unread;

pub use format::{Format, pose_tools};
pub use help::options_by_format;

use crate::source::Source;
use crate::{ImportError, Imported, Options, features, plausibility, tools};
use recognise::{Recognised, recognise};
use std::path::Path;
use table::{Adapter, Reader, adapters};
use tools::Tool;
use unread::ensure_read;
use yoto_proto::pose_track::describe;
use yoto_proto::v1::Violation;

/// Reads the capture in `dir`, without decoding its pictures.
///
/// # Errors
/// [`ImportError::BadCapture`] with file, frame and field, or [`ImportError::Unusable`] with these where `dir` is not
/// the folder of a capture; [`ImportError::File`] when the file system fails.
pub fn read(format: Format, dir: &Path, options: &Options) -> Result<Imported, ImportError> {
    read_any(format, dir, options).map_err(|error| by_path(error, dir))
}

/// `error`, with the path of the file if the file is outside of the capture in `dir`.
fn by_path(error: ImportError, dir: &Path) -> ImportError {
    let is_captures = |place: &str| dir.is_dir() && place == dir.display().to_string();
    match error {
        ImportError::BadCapture { place, violations } if !is_captures(&place) => {
            let describe = |violation: &Violation| {
                let path = Path::new(&place).join(&violation.file);
                let file = path.display().to_string();
                describe(&Violation {
                    file: file.trim_end_matches('/').to_owned(),
                    ..violation.clone()
                })
            };
            let lines: Vec<String> = violations.iter().map(describe).collect();
            ImportError::Unusable(lines.join("\n"))
        }
        error => error,
    }
}

fn read_any(format: Format, dir: &Path, options: &Options) -> Result<Imported, ImportError> {
    features::ensure_built(options)?;
    if let Some(adapter) = table::of(format) {
        return read_as(adapter, dir, options);
    }
    match recognise(dir, options)? {
        Recognised::Format(adapter, name) => {
            let mut imported = read_as(adapter, dir, options)?;
            if let Some(name) = name {
                imported.notes.insert(0, format!("recognised: {name}"));
            }
            Ok(imported)
        }
        Recognised::Tool => read_tool(None, dir, options),
    }
}

fn read_as(adapter: &Adapter, dir: &Path, options: &Options) -> Result<Imported, ImportError> {
    ensure_read(adapter, dir, options)?;
    let imported = match adapter.read {
        Reader::Folder(read) => read(&Source::new(dir), options)?,
        Reader::Clip(read) => read(dir, options)?,
        Reader::Tool(tool) => return read_tool(Some(tool), dir, options),
    };
    checked(dir, imported, options)
}

/// Reads the files of the tool `forced`, or of the tool that is recognised.
fn read_tool(
    forced: Option<&'static Tool>,
    dir: &Path,
    options: &Options,
) -> Result<Imported, ImportError> {
    let at = options.poses.as_deref().unwrap_or(dir);
    let (tool, found) = tools::open(at, forced, options)?;
    let is_of_tool =
        |adapter: &&Adapter| matches!(adapter.read, Reader::Tool(of) if std::ptr::eq(of, tool));
    if let Some(adapter) = adapters().iter().find(is_of_tool) {
        ensure_read(adapter, dir, options)?;
    }
    checked(dir, tools::capture(tool, &found, dir, options)?, options)
}

/// `imported`, if its track has no faults, with a note about frames that it lacks.
fn checked(dir: &Path, mut imported: Imported, options: &Options) -> Result<Imported, ImportError> {
    imported
        .notes
        .extend(options.beyond_last(imported.available));
    let violations = imported.track.check();
    if !violations.is_empty() {
        return Err(Source::new(dir).bad(violations));
    }
    plausibility::ensure(&mut imported)?;
    Ok(imported)
}
