//! Zip archives.

use super::{Sink, entries};
use crate::{MediaError, MediaFault};
use ::zip::ZipArchive;
use ::zip::result::ZipError;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Bits of a Unix mode with the kind of file, and their value for a plain file.
const KIND: u32 = 0o170_000;
const PLAIN: u32 = 0o100_000;
const FOLDER: u32 = 0o040_000;

pub(super) fn unpack(path: &Path, sink: &mut Sink<'_, '_>) -> Result<(), MediaError> {
    let file = File::open(path).map_err(MediaError::io(path))?;
    let mut file = BufReader::new(file);
    // The directory at the end has the number, before all entries are read.
    if let Some(entries) = entries::announced(&mut file).map_err(MediaError::io(path))? {
        sink.room_for(entries)?;
    }
    let mut archive = ZipArchive::new(file).map_err(|error| undecodable(&error))?;
    if archive.has_duplicate_names() {
        let message = "the archive has two entries of the same name";
        return Err(MediaFault::new("DUPLICATE", message).into());
    }
    // All declared sizes are checked together before anything is written.
    let declared = archive.decompressed_size();
    if declared.is_some_and(|bytes| bytes > u128::from(sink.budget)) {
        return Err(sink.bomb(String::new()).into());
    }
    for index in 0..archive.len() {
        let mut entry = archive
            .by_index(index)
            .map_err(|error| undecodable(&error))?;
        let raw = entry.name_raw().to_vec();
        let Some(name) = sink.admit(&raw, entry.size())? else {
            continue;
        };
        if entry.encrypted() {
            return Err(MediaFault::undecodable("this entry is encrypted")
                .in_field(name)
                .into());
        }
        let kind = entry.unix_mode().map_or(0, |mode| mode & KIND);
        if !matches!(kind, 0 | PLAIN | FOLDER) {
            let message = "this entry is a link or a device, not a file";
            return Err(MediaFault::new("UNSAFE_PATH", message)
                .in_field(name)
                .into());
        }
        if !entry.is_dir() {
            sink.write(name, &mut entry)?;
        }
    }
    Ok(())
}

fn undecodable(error: &ZipError) -> MediaFault {
    MediaFault::undecodable(format!("the zip archive can't be read: {error}"))
}
