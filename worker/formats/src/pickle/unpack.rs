//! The compressed forms that joblib writes.

use super::PickleError;
use flate2::read::{MultiGzDecoder, ZlibDecoder};
use std::borrow::Cow;
use std::io::Read;

/// Bytes of the length, in digits, before the data in files of joblib before 0.10.
const OLD_LENGTH: usize = 19;
/// First bytes of compressed forms that are not supported.
const OTHERS: [(&[u8], &str); 5] = [
    (b"BZh", "bz2"),
    (b"\x5d\x00", "lzma"),
    (b"\xfd7zXZ", "xz"),
    (b"\x04\"M\x18", "lz4"),
    (b"\x28\xb5\x2f\xfd", "zstd"),
];

/// The pickle in `bytes`, unpacked to at most `limit` bytes. No pickle starts like a compressed form, whose
/// first or second byte is not an instruction.
pub(super) fn unpacked(bytes: &[u8], limit: u64) -> Result<Cow<'_, [u8]>, PickleError> {
    if let Some((_, name)) = OTHERS.iter().find(|(first, _)| bytes.starts_with(first)) {
        return Err(PickleError::Compression(name));
    }
    match bytes {
        [b'x', ..] => limited(ZlibDecoder::new(bytes), limit),
        [0x1f, 0x8b, ..] => limited(MultiGzDecoder::new(bytes), limit),
        [b'Z', b'F', rest @ ..] => {
            let data = rest.get(OLD_LENGTH..).ok_or(PickleError::Truncated)?;
            // Versions up to 0.8.4 in Python 2 wrote one more space.
            limited(
                ZlibDecoder::new(data.strip_prefix(b" ").unwrap_or(data)),
                limit,
            )
        }
        _ => Ok(Cow::Borrowed(bytes)),
    }
}

fn limited<'a>(from: impl Read, limit: u64) -> Result<Cow<'a, [u8]>, PickleError> {
    let mut unpacked = Vec::new();
    from.take(limit.saturating_add(1))
        .read_to_end(&mut unpacked)
        .map_err(|error| PickleError::Damaged(error.to_string()))?;
    if unpacked.len() as u64 > limit {
        return Err(PickleError::Unpacked(limit));
    }
    Ok(Cow::Owned(unpacked))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::{GzEncoder, ZlibEncoder};
    use std::io::Write;

    fn zlib(data: &[u8]) -> Vec<u8> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(3));
        encoder.write_all(data).expect("writes");
        encoder.finish().expect("finishes")
    }

    #[test]
    fn every_form_of_joblib_is_told_from_a_pickle() {
        let pickle = b"\x80\x02K\x07.";
        let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
        gzip.write_all(pickle).expect("writes");
        let old = [b"ZF0x5                ".as_slice(), &zlib(pickle)].concat();
        let older = [b"ZF0x5                 ".as_slice(), &zlib(pickle)].concat();
        let gzip = gzip.finish().expect("finishes");
        for form in [pickle.to_vec(), zlib(pickle), gzip, old, older] {
            let unpacked = unpacked(&form, 100).expect("unpacks");
            assert_eq!(*unpacked, *pickle, "{form:x?}");
        }
        for (first, name) in OTHERS {
            let refused = unpacked(first, 100).expect_err("another form");
            assert_eq!(refused, PickleError::Compression(name));
        }
    }

    #[test]
    fn bombs_and_damage_are_errors() {
        let bomb = zlib(&[0; 1 << 20]);
        assert!(bomb.len() < 1 << 13);
        assert_eq!(unpacked(&bomb, 1000), Err(PickleError::Unpacked(1000)));
        let half = bomb.get(..bomb.len() / 2).expect("half");
        assert!(matches!(
            unpacked(half, 1 << 21),
            Err(PickleError::Damaged(_))
        ));
        assert_eq!(unpacked(b"ZF0x5", 100), Err(PickleError::Truncated));
    }
}
