//! Removes what a film's file tells beside the film: place, device, owner, comments. A phone writes the coordinates of the place into every
//! film, and a capture is given away.
//!
//! Bytes are overwritten where they are: the rest of the file keeps its place, so the film stays as it is.

mod iso;
mod matroska;
mod riff;

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Something that tags are removed from.
trait Container: Read + Write + Seek {}

impl<T: Read + Write + Seek> Container for T {}

/// Bytes that are overwritten at a time.
const BLOCK: usize = 64 << 10;

/// Removes the tags of the film at `path`: those of MP4 and MOV with their tracks of other data than pictures and sound, of Matroska and
/// WebM, and of AVI. A file of another kind stays as it is.
///
/// # Errors
/// When it can't be read or written.
pub fn remove_tags(path: &Path) -> io::Result<()> {
    let mut file = File::options().read(true).write(true).open(path)?;
    remove(&mut file)
}

fn remove(file: &mut impl Container) -> io::Result<()> {
    let start = read::<12>(file, 0)?;
    match start {
        Some([0x1a, 0x45, 0xdf, 0xa3, ..]) => matroska::remove(file),
        Some([b'R', b'I', b'F', b'F', _, _, _, _, b'A', b'V', b'I', b' ']) => riff::remove(file),
        Some(_) => iso::remove(file),
        None => Ok(()),
    }
}

/// `N` bytes at `at`; `None` if the file ends before.
fn read<const N: usize>(file: &mut impl Container, at: u64) -> io::Result<Option<[u8; N]>> {
    file.seek(SeekFrom::Start(at))?;
    let mut bytes = [0; N];
    match file.read_exact(&mut bytes) {
        Ok(()) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
        Err(error) => Err(error),
    }
}

fn length(file: &mut impl Container) -> io::Result<u64> {
    file.seek(SeekFrom::End(0))
}

fn write(file: &mut impl Container, at: u64, bytes: &[u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(at))?;
    file.write_all(bytes)
}

/// Overwrites the bytes from `from` up to `to` with zeros.
fn zero(file: &mut impl Container, from: u64, to: u64) -> io::Result<()> {
    let zeros = [0; BLOCK];
    file.seek(SeekFrom::Start(from))?;
    let mut left = to.saturating_sub(from);
    while left > 0 {
        let count = left.min(BLOCK as u64);
        file.write_all(&zeros[..count as usize])?;
        left -= count;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// The bytes of a file without its tags.
    pub(super) fn removed(bytes: &[u8]) -> Vec<u8> {
        let mut file = Cursor::new(bytes.to_vec());
        remove(&mut file).expect("removes");
        let after = file.into_inner();
        assert_eq!(after.len(), bytes.len(), "everything keeps its place");
        after
    }

    pub(super) fn has(bytes: &[u8], text: &[u8]) -> bool {
        bytes.windows(text.len()).any(|it| it == text)
    }

    #[test]
    fn films_without_tags_and_other_files_stay_as_they_are() {
        for name in ["flashsv.mkv", "mjpeg.avi"] {
            let clips = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clips");
            let bytes = std::fs::read(clips.join(name)).expect("a clip");
            let once = removed(&bytes);
            assert_eq!(removed(&once), once, "{name}");
        }
        for bytes in [&b""[..], b"YUV4MPEG2 W2 H2", &[0; 40], &[255; 40]] {
            assert_eq!(removed(bytes), bytes);
        }
    }
}
