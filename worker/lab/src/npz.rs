//! Arrays in a `.npz` file for `numpy.load`, for values that 8 bits can't hold.

use anyhow::Context;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

/// Alignment of an array's numbers in numpy's format, bytes.
const ALIGNMENT: usize = 64;
/// Bytes before the header's text: magic, version, length.
const PREFIX: usize = 10;

/// A named array of f32, rows first.
pub(crate) struct Array<'a> {
    pub name: &'a str,
    pub shape: &'a [usize],
    pub values: &'a [f32],
}

/// Writes `arrays` to `path`, making its folder.
pub(crate) fn write(path: &Path, arrays: &[Array]) -> anyhow::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    let action = || format!("writing {}", path.display());
    let mut archive = ZipWriter::new(BufWriter::new(File::create(path).with_context(action)?));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for array in arrays {
        archive
            .start_file(format!("{}.npy", array.name), options)
            .with_context(action)?;
        archive
            .write_all(&header(array.shape))
            .with_context(action)?;
        for value in array.values {
            archive
                .write_all(&value.to_le_bytes())
                .with_context(action)?;
        }
    }
    archive
        .finish()
        .with_context(action)?
        .flush()
        .with_context(action)
}

/// The header of format 1.0.
fn header(shape: &[usize]) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({sides})}}");
    // The text ends with a line feed.
    while !(PREFIX + text.len() + 1).is_multiple_of(ALIGNMENT) {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[test]
    fn arrays_come_back_from_the_archive() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a/frame.npz");
        let array = Array {
            name: "alpha",
            shape: &[2, 1],
            values: &[0.25, 1.0],
        };
        write(&path, &[array]).expect("writes");
        let file = File::open(&path).expect("is there");
        let mut archive = zip::ZipArchive::new(file).expect("an archive");
        let mut bytes = Vec::new();
        archive
            .by_name("alpha.npy")
            .expect("the array")
            .read_to_end(&mut bytes)
            .expect("reads");
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let (text, numbers) = bytes[PREFIX..].split_at(length);
        let text = String::from_utf8_lossy(text);
        assert!(
            text.contains("'shape': (2, 1, )") && text.ends_with('\n'),
            "{text}"
        );
        assert_eq!((PREFIX + length) % ALIGNMENT, 0);
        assert_eq!(
            numbers,
            [0.25f32.to_le_bytes(), 1f32.to_le_bytes()].concat()
        );
    }
}
