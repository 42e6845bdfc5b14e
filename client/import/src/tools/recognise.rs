//! Recognises the tool that wrote a file or a folder, by the contents.

use super::ALL;
use super::sieve::sieve;
use super::tool::{Location, Tool, ToolFile};
use crate::clip::fault;
use crate::proof::ToolOutput;
use crate::source::Source;
use crate::{ImportError, Options, keypoints, misplaced};
use std::path::Path;

/// Endings of the containers in which tools write.
const ENDINGS: [&str; 7] = ["pkl", "joblib", "pt", "pth", "npz", "npy", "json"];

/// Files of any name, which are tried after those of [`named_locations`].
const ANY_NAME: [Location; 5] = [
    ("", "", ".pkl"),
    ("", "", ".pt"),
    ("", "", ".pth"),
    ("", "", ".npz"),
    ("", "", ".json"),
];

/// The locations of the tools' files, the surest first.
fn named_locations() -> impl Iterator<Item = &'static Location> {
    let mut tools = ALL;
    tools.sort_by_key(|tool| tool.search_rank);
    tools.into_iter().flat_map(|tool| tool.locations)
}

/// The contents of the file or folder at `path`, and the tool that wrote it; `forced` if the user says
/// which.
///
/// # Errors
/// When no tool's files are there, with what was looked for; when a file is recognised but wrong.
pub(crate) fn open(
    path: &Path,
    forced: Option<&'static Tool>,
    options: &Options,
) -> Result<(&'static Tool, ToolOutput), ImportError> {
    if path.is_file() {
        let source = Source::new(path.parent().unwrap_or(Path::new("")));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        return read_file(&source, &name, forced, options)?.ok_or_else(|| unknown(path, forced));
    }
    let source = Source::new(path);
    if !path.is_dir() {
        return Err(fault(path, "MISSING", "there is no such file or folder"));
    }
    // A damaged or foreign file does not hide the tool's file beside it.
    let mut first_fault = None;
    for name in candidates(&source)? {
        match read_file(&source, &name, forced, options) {
            Ok(Some(found)) => return Ok(found),
            Ok(None) => {}
            Err(fault) => {
                first_fault.get_or_insert(fault);
            }
        }
    }
    Err(first_fault.unwrap_or_else(|| unknown(path, forced)))
}

/// The tool that wrote the file at `path`, if one did.
pub(crate) fn wrote(path: &Path) -> Option<&'static str> {
    let ending = path.extension()?.to_str()?;
    if !path.is_file() || !ENDINGS.contains(&ending) {
        return None;
    }
    let source = Source::new(path.parent().unwrap_or(Path::new("")));
    let data = source.data(path.file_name()?.to_str()?, None).ok()?;
    let tool = ALL.into_iter().find(|tool| (tool.fits)(&data.root()))?;
    Some(tool.documented.tool)
}

/// Whether the folder holds files with the names of a tool's.
pub(crate) fn has_files(path: &Path) -> bool {
    let source = Source::new(path);
    named_locations().any(|location| first(&source, location).is_ok_and(|name| name.is_some()))
}

/// The first file of every location, the surest first.
fn candidates(source: &Source) -> Result<Vec<String>, ImportError> {
    let mut names = Vec::new();
    for location in named_locations().chain(&ANY_NAME) {
        if let Some(name) = first(source, location)?
            && !names.contains(&name)
        {
            names.push(name);
        }
    }
    Ok(names)
}

fn first(source: &Source, location: &Location) -> Result<Option<String>, ImportError> {
    let (folder, start, ending) = *location;
    if !source.path(folder).is_dir() {
        return Ok(None);
    }
    let names = source.list(folder, &[ending])?;
    let starts = |name: &&String| {
        let name = name
            .rsplit_once('/')
            .map_or(name.as_str(), |(_, name)| name);
        name.starts_with(start)
    };
    let name = names.iter().find(starts);
    Ok(name.map(|name| name.trim_start_matches('/').to_owned()))
}

/// The contents of `file`; `None` when no tool wrote it, or a tool other than `forced`.
fn read_file(
    source: &Source,
    file: &str,
    forced: Option<&'static Tool>,
    options: &Options,
) -> Result<Option<(&'static Tool, ToolOutput)>, ImportError> {
    let ending = Path::new(file)
        .extension()
        .and_then(|ending| ending.to_str());
    if !ending.is_some_and(|ending| ENDINGS.contains(&ending)) {
        return Ok(None);
    }
    let data = source.data(file, None)?;
    let root = data.root();
    let is_wanted = |tool: &&Tool| forced.is_none_or(|forced| std::ptr::eq(forced, *tool));
    let mut wanted = ALL.into_iter().filter(is_wanted);
    let Some(tool) = wanted.find(|tool| (tool.fits)(&root)) else {
        return Ok(None);
    };
    let mut found = (tool.read)(&ToolFile {
        root: &root,
        source,
        name: file,
        options,
    })?;
    sieve(&mut found, &root)?;
    if found.people.iter().all(|person| person.seen.is_empty()) {
        let message = format!("{} saw nobody in any frame", tool.documented.tool);
        return Err(source.fault("EMPTY", file, None, "", message));
    }
    Ok(Some((tool, found)))
}

/// The error about files that no tool wrote: what they are, and what was searched for.
fn unknown(path: &Path, forced: Option<&'static Tool>) -> ImportError {
    let looked = match forced {
        Some(tool) => format!("{}: {}", tool.documented.tool, tool.files),
        None => {
            let tools = ALL.map(|tool| tool.documented.tool);
            format!(
                "the poses of {}, a .bvh, and key points of {}",
                tools.join(", "),
                keypoints::looked_for()
            )
        }
    };
    misplaced::unknown(path, &looked)
}
