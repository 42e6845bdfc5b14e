//! Unpacks archives into plain files.
//!
//! Entries are written under numbers, never under their own names, so that no name can lead
//! outside the folder. The names are only checked and kept in a list. Declared sizes are compared with
//! the limits before unpacking, and actual sizes during it.

mod entries;
mod name;
mod tar;
mod zip;

use crate::{Limits, MediaError, MediaFault, sniff};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Bytes that an archive may always unpack to, regardless of its own size.
const ALWAYS: u64 = 64 << 20;

/// The files of a capture: path inside it to path on this disk.
pub type Files = BTreeMap<String, PathBuf>;

/// Unpacks archives into one folder, within limits that hold for all of them together.
#[derive(Debug)]
pub struct Unpacker<'a> {
    limits: &'a Limits,
    folder: &'a Path,
    written: u64,
    entries: usize,
}

impl<'a> Unpacker<'a> {
    /// Unpacks into `folder`, which must exist.
    pub fn new(folder: &'a Path, limits: &'a Limits) -> Self {
        Self {
            limits,
            folder,
            written: 0,
            entries: 0,
        }
    }

    /// The entries of the archive at `path`, by their names in it.
    ///
    /// # Errors
    /// A fault, with the entry's name as its field, if the file is not an archive, is cut short or
    /// encrypted; if a name is not UTF-8, leads outside the archive, or is repeated; for links and devices;
    /// and for more entries or bytes than allowed.
    pub fn unpack(&mut self, path: &Path) -> Result<Files, MediaError> {
        let mut file = File::open(path).map_err(MediaError::io(path))?;
        let size = file.metadata().map_err(MediaError::io(path))?.len();
        let mut start = Vec::new();
        (&mut file)
            .take(sniff::PREFIX as u64)
            .read_to_end(&mut start)
            .map_err(MediaError::io(path))?;
        if start.is_empty() {
            return Err(MediaFault::new("EMPTY", "the file has no bytes").into());
        }
        let budget = (self.limits.unpacked_bytes - self.written).min(
            size.saturating_mul(self.limits.unpacked_ratio)
                .saturating_add(ALWAYS),
        );
        let mut sink = Sink {
            unpacker: self,
            files: Files::new(),
            folded: BTreeMap::new(),
            budget,
        };
        match sniff::kind(&start) {
            sniff::FileType::Zip => zip::unpack(path, &mut sink)?,
            sniff::FileType::Tar => tar::unpack(path, false, &mut sink)?,
            sniff::FileType::Gzip => tar::unpack(path, true, &mut sink)?,
            other => {
                let message = format!("is {}; zip, tar and tar.gz are unpacked", other.name());
                return Err(MediaFault::undecodable(message).into());
            }
        }
        Ok(sink.files)
    }
}

/// Destination of the entries.
struct Sink<'u, 'a> {
    unpacker: &'u mut Unpacker<'a>,
    files: Files,
    /// Names in lower case, since some file systems ignore case.
    folded: BTreeMap<String, ()>,
    /// Remaining bytes that this archive may unpack to.
    budget: u64,
}

impl Sink<'_, '_> {
    /// Checks that as many `more` entries are allowed.
    fn room_for(&self, more: u64) -> Result<(), MediaFault> {
        let most = self.unpacker.limits.entries;
        let left = most.saturating_sub(self.unpacker.entries);
        match usize::try_from(more).is_ok_and(|it| it <= left) {
            true => Ok(()),
            false => Err(MediaFault::new(
                "TOO_LARGE",
                format!("more than {most} entries"),
            )),
        }
    }

    /// Checks an entry before its content is read. `None` for entries to skip.
    fn admit(&mut self, raw: &[u8], declared: u64) -> Result<Option<String>, MediaFault> {
        self.unpacker.entries += 1;
        if self.unpacker.entries > self.unpacker.limits.entries {
            let message = format!("more than {} entries", self.unpacker.limits.entries);
            return Err(MediaFault::new("TOO_LARGE", message));
        }
        let Some(name) = name::checked(raw)? else {
            return Ok(None);
        };
        if self.folded.insert(name.to_lowercase(), ()).is_some() {
            let message = "the archive has two entries of this name";
            return Err(MediaFault::new("DUPLICATE", message).in_field(name));
        }
        if declared > self.budget {
            return Err(self.bomb(name));
        }
        Ok(Some(name))
    }

    /// Writes an admitted entry.
    fn write(&mut self, name: String, content: &mut dyn Read) -> Result<(), MediaError> {
        let path = self
            .unpacker
            .folder
            .join(format!("{:06}", self.unpacker.entries));
        let mut file = File::create(&path).map_err(MediaError::io(&path))?;
        let mut buffer = vec![0; 64 << 10];
        loop {
            let count = match content.read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(error) => {
                    let message = format!("can't be unpacked: {error}");
                    return Err(MediaFault::undecodable(message).in_field(name).into());
                }
            };
            let bytes = count as u64;
            // The declared size may be a lie, so the bytes that really come out are counted as well.
            if bytes > self.budget {
                return Err(self.bomb(name).into());
            }
            self.budget -= bytes;
            self.unpacker.written += bytes;
            file.write_all(&buffer[..count])
                .map_err(MediaError::io(&path))?;
        }
        self.files.insert(name, path);
        Ok(())
    }

    fn bomb(&self, name: String) -> MediaFault {
        let message = format!(
            "unpacks to more than allowed: {} bytes for all archives of a capture, and {} times \
             the archive's own size beyond {ALWAYS}",
            self.unpacker.limits.unpacked_bytes, self.unpacker.limits.unpacked_ratio
        );
        MediaFault::new("TOO_LARGE", message).in_field(name)
    }
}

#[cfg(test)]
mod tests;
