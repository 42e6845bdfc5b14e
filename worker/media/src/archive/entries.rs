//! The number of entries that a zip archive announces in the record at its end (APPNOTE.TXT 4.3.14 and 4.3.16), which is read without its
//! directory.

use std::io::{self, Read, Seek, SeekFrom};

/// Length of the record without its comment.
const RECORD: u64 = 22;
/// Longest comment after it.
const COMMENT: u64 = u16::MAX as u64;
/// How the record begins, and the one of Zip64 before it.
const END: &[u8] = b"PK\x05\x06";
const END_64: &[u8] = b"PK\x06\x06";
/// Length of the record of Zip64 up to its number of entries, and of the number.
const NUMBER_64: usize = 32;
/// What stands as the number where the record of Zip64 has it.
const ELSEWHERE: u16 = u16::MAX;

/// The announced number; `None` if there is no such record. The file is at its beginning afterwards.
pub(super) fn announced(file: &mut (impl Read + Seek)) -> io::Result<Option<u64>> {
    let length = file.seek(SeekFrom::End(0))?;
    // The locator and the record of Zip64 come right before it.
    let tail = length.min(RECORD + COMMENT + 128);
    file.seek(SeekFrom::Start(length - tail))?;
    let mut bytes = Vec::new();
    file.take(tail).read_to_end(&mut bytes)?;
    file.rewind()?;
    Ok(number(&bytes))
}

fn number(tail: &[u8]) -> Option<u64> {
    let last = |mark: &[u8], before: usize| {
        tail[..before]
            .windows(mark.len())
            .rposition(|it| it == mark)
    };
    let at = last(END, tail.len())?;
    let number = tail.get(at + 10..at + 12)?;
    let number = u16::from_le_bytes(number.try_into().ok()?);
    if number != ELSEWHERE {
        return Some(number.into());
    }
    let Some(at) = last(END_64, at) else {
        return Some(number.into());
    };
    let number = tail.get(at + NUMBER_64..at + NUMBER_64 + 8)?;
    Some(u64::from_le_bytes(number.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write};
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    fn archive(entries: usize, comment: &str) -> Cursor<Vec<u8>> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for number in 0..entries {
            zip.start_file(number.to_string(), SimpleFileOptions::default())
                .expect("begins");
            zip.write_all(b"x").expect("writes");
        }
        zip.set_comment(comment).expect("is short");
        zip.finish().expect("ends")
    }

    #[test]
    fn the_number_is_that_of_the_entries() {
        for (entries, comment) in [
            (0, ""),
            (3, ""),
            (3, "a note"),
            (65_534, ""),
            (70_000, "a note"),
        ] {
            let mut file = archive(entries, comment);
            let found = announced(&mut file).expect("reads");
            assert_eq!(found, Some(entries as u64), "{entries} {comment}");
            assert_eq!(file.position(), 0);
        }
    }

    #[test]
    fn other_files_announce_nothing() {
        for bytes in [&b""[..], b"PK\x05", b"PK\x05\x06", &[7; 100_000]] {
            let found = announced(&mut Cursor::new(bytes)).expect("reads");
            assert_eq!(found, None);
        }
    }
}
