//! `.npz` files, made up or with other numbers.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use yoto_formats::{Array, Value, npz};
use zip::write::{SimpleFileOptions, ZipWriter};

/// Writes the arrays of `from` to `to`, each as `change` leaves it; those that it empties are left out.
pub(crate) fn rewrite(from: &Path, to: &Path, change: impl Fn(&str, &mut Array)) {
    let mut bytes = Vec::new();
    File::open(from)
        .and_then(|mut file| file.read_to_end(&mut bytes))
        .expect("reads");
    let value = npz::read(&bytes, 1 << 24).expect("an npz");
    let mut archive = ZipWriter::new(File::create(to).expect("a file"));
    for (name, array) in value.entries().expect("arrays") {
        let name = name.text().expect("a name");
        let Value::Array(array) = array else {
            continue;
        };
        let mut array = array.clone();
        change(name, &mut array);
        if array.values.is_empty() {
            continue;
        }
        let options = SimpleFileOptions::default();
        let options = options.compression_method(zip::CompressionMethod::Stored);
        archive
            .start_file(format!("{name}.npy"), options)
            .expect("a place");
        archive.write_all(&header(&array.shape)).expect("writes");
        for value in &array.values {
            archive
                .write_all(&(*value as f32).to_le_bytes())
                .expect("writes");
        }
    }
    archive.finish().expect("writes");
}

/// Writes arrays with names, shapes and values to `to`.
pub(crate) fn write(to: &Path, arrays: &[(&str, &[usize], &[f64])]) {
    let mut archive = ZipWriter::new(File::create(to).expect("a file"));
    for (name, shape, values) in arrays {
        let options = SimpleFileOptions::default();
        let options = options.compression_method(zip::CompressionMethod::Stored);
        archive
            .start_file(format!("{name}.npy"), options)
            .expect("a place");
        archive.write_all(&header(shape)).expect("writes");
        for value in *values {
            archive
                .write_all(&(*value as f32).to_le_bytes())
                .expect("writes");
        }
    }
    archive.finish().expect("writes");
}

fn header(shape: &[usize]) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({sides})}}");
    let text = format!("{text:<117}\n");
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    header
}
