//! The files of a capture's folder, by their names in the upload.

use crate::ImportError;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use yoto_proto::media_plan::{
    ARCHIVE_ENDINGS, PICTURE_ENDINGS, VIDEO_ENDINGS, has_ending, index_in_name,
};
use yoto_proto::pose_track::violation;

/// Possible folders of a capture's media, below its own folder.
const BELOW: [&str; 2] = ["train", ""];
/// Folders to list.
const FOLDERS: [&str; 2] = ["frames", "masks"];

/// Files at the top, and pictures by folder and frame.
#[derive(Debug)]
pub(super) struct Listing {
    root: PathBuf,
    top: BTreeMap<String, PathBuf>,
    pictures: BTreeMap<(String, u32), PathBuf>,
    /// One entry per source: files, and the first picture of each folder.
    sources: Vec<String>,
}

impl Listing {
    /// Lists `dir`, or its `train/` if the media are there: the default folders and those called
    /// `named`.
    pub(super) fn of(dir: &Path, named: &[&str]) -> Result<Self, ImportError> {
        let root = BELOW
            .map(|below| dir.join(below))
            .into_iter()
            .find(|root| holds_images(root))
            .unwrap_or_else(|| dir.to_owned());
        let mut listing = Self {
            top: BTreeMap::new(),
            pictures: BTreeMap::new(),
            sources: Vec::new(),
            root,
        };
        for (name, path) in files(&listing.root)? {
            let archive = ARCHIVE_ENDINGS.iter().find(|it| name.ends_with(**it));
            if let Some(stem) = archive.and_then(|ending| name.strip_suffix(ending)) {
                // It becomes a folder of its name.
                listing.sources.push(format!("{stem}/"));
            } else if has_ending(&name, &VIDEO_ENDINGS) || has_ending(&name, &PICTURE_ENDINGS) {
                listing.sources.push(name.clone());
            } else {
                continue;
            }
            listing.top.insert(name, path);
        }
        let inside = |name: &&str| Path::new(name).components().all(is_plain);
        let named = named.iter().map(|name| name.trim_end_matches('/'));
        let mut folders: Vec<&str> = FOLDERS.into_iter().chain(named.filter(inside)).collect();
        folders.sort_unstable();
        folders.dedup();
        for folder in folders {
            listing.look_into(folder, dir)?;
        }
        Ok(listing)
    }

    fn look_into(&mut self, folder: &str, dir: &Path) -> Result<(), ImportError> {
        let path = self.root.join(folder);
        if !path.is_dir() {
            return Ok(());
        }
        self.sources.push(format!("{folder}/"));
        if let Some(name) = nameless(&path)? {
            let message = "the name of this file is not text (UTF-8), so its frame is unknown";
            return Err(ImportError::BadCapture {
                place: dir.display().to_string(),
                violations: vec![violation(
                    "BAD_NAME",
                    &format!("{folder}/{name}"),
                    None,
                    "",
                    message,
                )],
            });
        }
        for (name, path) in files(&path)? {
            let index = index_in_name(&name).filter(|_| has_ending(&name, &PICTURE_ENDINGS));
            let Some(index) = index else { continue };
            if let Some(other) = self.pictures.insert((folder.to_owned(), index), path) {
                let other = other.file_name().unwrap_or_default().to_string_lossy();
                let message = format!("{other} is a picture of the same frame");
                let name = format!("{folder}/{name}");
                return Err(ImportError::BadCapture {
                    place: dir.display().to_string(),
                    violations: vec![violation("DUPLICATE", &name, Some(index), "", message)],
                });
            }
        }
        Ok(())
    }

    /// Folder of the media.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// Names that identify the sources.
    pub(super) fn sources(&self) -> impl Iterator<Item = &str> + Clone {
        self.sources.iter().map(String::as_str)
    }

    /// The video used as frames.
    pub(super) fn video(&self) -> Option<String> {
        let fits = |name: &&String| name.starts_with("video.") && has_ending(name, &VIDEO_ENDINGS);
        self.top.keys().find(fits).cloned()
    }

    /// Whether there are frames as pictures.
    pub(super) fn has_frames(&self) -> bool {
        self.sources().any(|name| name == "frames/")
    }

    /// The archive that unpacks to `folder`, unless the folder exists.
    pub(super) fn archive_of(&self, folder: &str) -> Option<(String, PathBuf)> {
        if self.root.join(folder).is_dir() {
            return None;
        }
        let names = ARCHIVE_ENDINGS.map(|ending| format!("{folder}{ending}"));
        names.into_iter().find_map(|name| self.file(&name))
    }

    /// The files at the top, by name.
    pub(super) fn top(&self) -> &BTreeMap<String, PathBuf> {
        &self.top
    }

    /// A file at the top.
    pub(super) fn file(&self, name: &str) -> Option<(String, PathBuf)> {
        Some((name.to_owned(), self.top.get(name)?.clone()))
    }

    /// The picture of a frame, with its name in the upload, since names on this disk are
    /// arbitrary.
    pub(super) fn picture(&self, folder: &str, index: u32) -> Option<(String, PathBuf)> {
        let path = self.pictures.get(&(folder.to_owned(), index))?;
        let ending = path.extension()?.to_str()?.to_lowercase();
        Some((format!("{folder}/{index:06}.{ending}"), path.clone()))
    }
}

fn is_plain(part: Component<'_>) -> bool {
    matches!(part, Component::Normal(_))
}

fn holds_images(root: &Path) -> bool {
    let top = files(root).unwrap_or_default();
    root.join("frames").is_dir()
        || top
            .iter()
            .any(|(name, _)| name.starts_with("frames.") || name.starts_with("video."))
}

/// A lossy form of a file name that is not text.
fn nameless(folder: &Path) -> Result<Option<String>, ImportError> {
    let failed = |error| ImportError::file("reading", folder)(error);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        if name.to_str().is_none() {
            return Ok(Some(name.to_string_lossy().into_owned()));
        }
    }
    Ok(None)
}

/// The files of a folder whose names are text, by name.
fn files(folder: &Path) -> Result<Vec<(String, PathBuf)>, ImportError> {
    let failed = |error| ImportError::file("reading", folder)(error);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().and_then(|name| name.to_str());
        if let Some(name) = name.filter(|name| !name.starts_with('.'))
            && path.is_file()
        {
            found.push((name.to_owned(), path));
        }
    }
    found.sort();
    Ok(found)
}
