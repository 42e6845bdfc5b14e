//! Tar archives, plain or gzipped.

use super::Sink;
use crate::{MediaError, MediaFault};
use ::tar::Archive;
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

pub(super) fn unpack(
    path: &Path,
    gzipped: bool,
    sink: &mut Sink<'_, '_>,
) -> Result<(), MediaError> {
    let file = BufReader::new(File::open(path).map_err(MediaError::io(path))?);
    let reader: Box<dyn Read> = if gzipped {
        Box::new(MultiGzDecoder::new(file))
    } else {
        Box::new(file)
    };
    // Skipped entries and headers are unpacked as well, and count towards the limit.
    let most = sink
        .budget
        .saturating_add(1024 * sink.unpacker.limits.entries as u64);
    let mut archive = Archive::new(reader.take(most));
    for entry in archive.entries().map_err(|error| undecodable(&error))? {
        let mut entry = entry.map_err(|error| undecodable(&error))?;
        let kind = entry.header().entry_type();
        if kind.is_pax_global_extensions() {
            continue;
        }
        let raw = entry.path_bytes().into_owned();
        let Some(name) = sink.admit(&raw, entry.size())? else {
            continue;
        };
        if kind.is_dir() {
            continue;
        }
        if !(kind.is_file() || kind.is_contiguous() || kind.is_gnu_sparse()) {
            let message = "this entry is a link or a device, not a file";
            return Err(MediaFault::new("UNSAFE_PATH", message)
                .in_field(name)
                .into());
        }
        let declared = entry.size();
        let before = sink.budget;
        sink.write(name.clone(), &mut entry)?;
        if before - sink.budget != declared {
            let message = "the archive is cut short inside this entry";
            return Err(MediaFault::undecodable(message).in_field(name).into());
        }
    }
    Ok(())
}

fn undecodable(error: &std::io::Error) -> MediaFault {
    MediaFault::undecodable(format!("the tar archive can't be read: {error}"))
}
