//! `.npz`: several arrays by name, in the format of `numpy.savez` and `numpy.savez_compressed`.

use crate::Value;
use crate::npy::{self, NpyError};
use crate::pickle::Budget;
use std::io::{Cursor, Read};
use thiserror::Error;
use zip::ZipArchive;

/// Most arrays in a file.
const MAX_ARRAYS: usize = 4096;

/// Why a `.npz` can't be read.
#[derive(Debug, Error)]
pub enum NpzError {
    /// Not an archive, or a damaged one.
    #[error("not a .npz archive: {0}")]
    Archive(#[from] zip::result::ZipError),
    /// An entry can't be unpacked.
    #[error("{name}: {source}")]
    Unpack {
        /// Name of the array.
        name: String,
        /// Why.
        source: std::io::Error,
    },
    /// An entry is not an array.
    #[error("{name}: {source}")]
    Array {
        /// Name of the array.
        name: String,
        /// Why.
        source: NpyError,
    },
    /// More bytes than the limit, or too many arrays: a few kilobytes can unpack to any size.
    #[error("the archive unpacks to more than {0} bytes, or to thousands of arrays")]
    TooLarge(u64),
}

/// The arrays of an archive, by name, as [`npy::read`] returns them. At most `limit` bytes are
/// unpacked, and the pickles of arrays of objects share the limits of one.
///
/// # Errors
/// When the bytes are not a valid archive, or unpack to more.
pub fn read(bytes: &[u8], limit: u64) -> Result<Value, NpzError> {
    read_without(bytes, limit, &[])
}

/// Reads as [`read`] does, with [`Value::Nothing`] for arrays and dictionary values with names in `without`. Such arrays are not
/// unpacked, and don't count towards the limit.
///
/// # Errors
/// The same errors as [`read`].
pub fn read_without(bytes: &[u8], limit: u64, without: &[&str]) -> Result<Value, NpzError> {
    let mut archive = ZipArchive::new(Cursor::new(bytes))?;
    if archive.len() > MAX_ARRAYS {
        return Err(NpzError::TooLarge(limit));
    }
    let mut left = limit;
    // Each array of objects is a pickle, which can unfold to more data than its entry has bytes.
    let mut budget = Budget::default();
    budget.unpacked = budget.unpacked.min(limit);
    let mut arrays = Vec::new();
    for at in 0..archive.len() {
        let entry = archive.by_index(at)?;
        let name = entry.name()?.trim_end_matches(".npy").to_owned();
        if without.contains(&name.as_str()) {
            arrays.push((Value::Text(name), Value::Nothing));
            continue;
        }
        let mut data = Vec::new();
        // The sizes in the archive may be false, so only the unpacked bytes count.
        entry
            .take(left.saturating_add(1))
            .read_to_end(&mut data)
            .map_err(|source| NpzError::Unpack {
                name: name.clone(),
                source,
            })?;
        left = left
            .checked_sub(data.len() as u64)
            .ok_or(NpzError::TooLarge(limit))?;
        let value = npy::read_within(&data, without, &mut budget);
        let value = value.map_err(|source| NpzError::Array {
            name: name.clone(),
            source,
        })?;
        arrays.push((Value::Text(name), value));
    }
    Ok(Value::Dict(arrays))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pickle::PickleError;
    use flate2::write::ZlibEncoder;
    use std::io::Write;
    use zip::CompressionMethod;
    use zip::write::{SimpleFileOptions, ZipWriter};

    fn archive(method: CompressionMethod, count: usize) -> Vec<u8> {
        let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({count},), }}");
        let mut npy = b"\x93NUMPY\x01\x00".to_vec();
        npy.extend((header.len() as u16).to_le_bytes());
        npy.extend(header.as_bytes());
        npy.resize(npy.len() + count, 7);
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(method);
        writer.start_file("a.npy", options).expect("starts");
        writer.write_all(&npy).expect("writes");
        writer.finish().expect("finishes").into_inner()
    }

    #[test]
    fn arrays_have_names_whether_packed_or_not() {
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let value = read(&archive(method, 3), 1 << 20).expect("reads");
            let array = value.get("a").and_then(Value::numbers).expect("numbers");
            assert_eq!((array.shape, array.values), (vec![3], vec![7.0; 3]));
        }
    }

    #[test]
    fn a_bomb_stops_at_the_limit() {
        let bomb = archive(CompressionMethod::Deflated, 1 << 22);
        assert!(bomb.len() < 1 << 14, "{}", bomb.len());
        assert!(matches!(read(&bomb, 1 << 20), Err(NpzError::TooLarge(_))));
        let less = read_without(&bomb, 1 << 20, &["a"]).expect("reads");
        assert_eq!(less.get("a"), Some(&Value::Nothing));
        assert!(matches!(read(b"no archive", 9), Err(NpzError::Archive(_))));
        let all = read(&archive(CompressionMethod::Stored, 3), u64::MAX);
        assert!(all.is_ok(), "the largest limit is one, too: {all:?}");
    }

    /// An archive of `count` arrays of an object each: `pickle`, compressed as joblib does.
    fn of_objects(pickle: &[u8], count: usize) -> Vec<u8> {
        let header = "{'descr': '|O', 'fortran_order': False, 'shape': (), }";
        let mut npy = b"\x93NUMPY\x01\x00".to_vec();
        npy.extend((header.len() as u16).to_le_bytes());
        npy.extend(header.as_bytes());
        let mut packed = ZlibEncoder::new(npy, flate2::Compression::fast());
        packed.write_all(pickle).expect("writes");
        let npy = packed.finish().expect("finishes");
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for at in 0..count {
            let options = SimpleFileOptions::default();
            let started = writer.start_file(format!("{at}.npy"), options);
            started.expect("starts");
            writer.write_all(&npy).expect("writes");
        }
        writer.finish().expect("finishes").into_inner()
    }

    #[test]
    fn bombs_in_the_arrays_of_objects_share_the_limits_of_the_file() {
        // A text of 60,000 letters.
        let text = [b"X".as_slice(), &60_000u32.to_le_bytes()].concat();
        let text = [b"\x80\x02", &text[..], &[b'a'; 60_000], b"."].concat();
        assert!(read(&of_objects(&text, 1), 100_000).is_ok());
        let two = read(&of_objects(&text, 2), 100_000);
        assert!(matches!(
            two,
            Err(NpzError::Array { name, source: NpyError::Pickle(PickleError::Unpacked(_)) }) if name == "1"
        ));
        // A list of a million numbers.
        let numbers = [b"\x80\x02](", &b"K\x07".repeat(1 << 20)[..], b"e."].concat();
        assert!(read(&of_objects(&numbers, 3), 1 << 30).is_ok());
        let four = read(&of_objects(&numbers, 4), 1 << 30);
        assert!(matches!(
            four,
            Err(NpzError::Array { name, source: NpyError::Pickle(PickleError::TooLarge) }) if name == "3"
        ));
    }
}
