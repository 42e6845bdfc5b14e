//! Files of `torch.save`, in both forms: a zip archive, and up to torch 1.5 a sequence of pickles followed by the tensors'
//! bytes. As in [`pickle`](crate::pickle), nothing is called.

use crate::Value;
use crate::pickle::{MAGIC, PickleError, read_legacy, read_with_storages};
use std::io::{Cursor, Read};
use thiserror::Error;
use zip::ZipArchive;
use zip::result::ZipError;

/// Most entries in an archive; each tensor is one.
const MAX_ENTRIES: usize = 1 << 16;
/// Longest text in the entry with the byte order.
const MAX_ORDER: usize = 16;

/// Why a file of torch can't be read.
#[derive(Debug, Error)]
pub enum TorchError {
    /// Neither of the two forms.
    #[error("not a file of torch.save: neither a zip archive nor torch's older form")]
    Form,
    /// A damaged archive.
    #[error("not an archive of torch.save: {0}")]
    Archive(#[from] ZipError),
    /// The archive has no `data.pkl`, or several.
    #[error("the archive has {0} data.pkl instead of one")]
    Main(usize),
    /// A program (TorchScript), not data.
    #[error("the file is a TorchScript program, which is not plain data")]
    Script,
    /// An entry can't be unpacked.
    #[error("{name}: {source}")]
    Unpack {
        /// Name of the entry.
        name: String,
        /// Why.
        source: std::io::Error,
    },
    /// The number of a tensor's bytes does not match its numbers.
    #[error("{name} has {found} bytes instead of {needed}")]
    Size {
        /// Name of the entry.
        name: String,
        /// Bytes of the entry.
        found: usize,
        /// Bytes of the numbers.
        needed: usize,
    },
    /// The byte order is neither of the two.
    #[error("the archive's byte order is neither \"little\" nor \"big\"")]
    Order,
    /// A few kilobytes can unpack to any size.
    #[error("the archive unpacks to more than {0} bytes, or has thousands of entries")]
    TooLarge(u64),
    /// The pickle, which has everything except the numbers, is invalid.
    #[error(transparent)]
    Pickle(#[from] PickleError),
}

/// The value in `bytes`, with tensors as [`Value::Array`]. At most `limit` bytes are unpacked.
///
/// # Errors
/// If the bytes are not a file of `torch.save` with plain data, or unpack to more.
pub fn read(bytes: &[u8], limit: u64) -> Result<Value, TorchError> {
    match bytes {
        [b'P', b'K', ..] => zipped(bytes, limit),
        [0x80, _, rest @ ..] if rest.starts_with(MAGIC) => Ok(read_legacy(bytes)?),
        _ => Err(TorchError::Form),
    }
}

/// Reads an archive: `NAME/data.pkl`, with a storage's bytes in `NAME/data/KEY`.
fn zipped(bytes: &[u8], limit: u64) -> Result<Value, TorchError> {
    let mut archive = Archive {
        zip: ZipArchive::new(Cursor::new(bytes))?,
        limit,
        left: limit,
    };
    if archive.zip.len() > MAX_ENTRIES {
        return Err(TorchError::TooLarge(limit));
    }
    let mut folders = Vec::new();
    for name in archive.zip.file_names() {
        if let Some((folder, "data.pkl")) = name?.split_once('/') {
            folders.push(folder.to_owned());
        }
    }
    let [folder] = folders.as_slice() else {
        return Err(TorchError::Main(folders.len()));
    };
    if archive.has(&format!("{folder}/constants.pkl")) {
        return Err(TorchError::Script);
    }
    let order = format!("{folder}/byteorder");
    // This entry exists since torch 2.1.
    let big_endian = if archive.has(&order) {
        match archive.entry(&order, MAX_ORDER)?.trim_ascii() {
            b"little" => false,
            b"big" => true,
            _ => return Err(TorchError::Order),
        }
    } else {
        false
    };
    let main = archive.entry(&format!("{folder}/data.pkl"), usize::MAX)?;
    read_with_storages(&main, big_endian, |key, needed| {
        let name = format!("{folder}/data/{key}");
        let data = archive.entry(&name, needed)?;
        let found = data.len();
        if found == needed {
            Ok(data)
        } else {
            Err(TorchError::Size {
                name,
                found,
                needed,
            })
        }
    })
}

struct Archive<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    limit: u64,
    left: u64,
}

impl Archive<'_> {
    fn has(&self, name: &str) -> bool {
        self.zip.index_for_name(name).is_some()
    }

    /// The bytes of an entry, at most one more than `most`, which shows that it is too long.
    fn entry(&mut self, name: &str, most: usize) -> Result<Vec<u8>, TorchError> {
        let entry = self.zip.by_name(name)?;
        // The sizes in the archive may be false, so only the unpacked bytes count.
        let most = (most as u64).min(self.left).saturating_add(1);
        let mut data = Vec::new();
        entry
            .take(most)
            .read_to_end(&mut data)
            .map_err(|source| TorchError::Unpack {
                name: name.to_owned(),
                source,
            })?;
        let left = self.left.checked_sub(data.len() as u64);
        self.left = left.ok_or(TorchError::TooLarge(self.limit))?;
        Ok(data)
    }
}

#[cfg(test)]
mod tests;
