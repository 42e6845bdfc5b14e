//! `.glb` files: glTF 2.0 in one file, with its numbers in a binary part.

use serde_json::{Value, json};
use std::io::{self, Write};

/// The use of a part of the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Vertex attributes.
    Vertices,
    /// Corners of triangles.
    Triangles,
    /// Anything else.
    Other,
}

/// A number as glTF stores it.
pub trait Number: Copy {
    /// glTF's code of the type.
    const CODE: u32;
    /// Adds the number's bytes, little-endian.
    fn put(self, to: &mut Vec<u8>);
}

impl Number for f32 {
    const CODE: u32 = 5126;
    fn put(self, to: &mut Vec<u8>) {
        to.extend(self.to_le_bytes());
    }
}

impl Number for u32 {
    const CODE: u32 = 5125;
    fn put(self, to: &mut Vec<u8>) {
        to.extend(self.to_le_bytes());
    }
}

impl Number for u8 {
    const CODE: u32 = 5121;
    fn put(self, to: &mut Vec<u8>) {
        to.push(self);
    }
}

/// The parts of a file's numbers.
#[derive(Debug, Default)]
pub struct Numbers {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Numbers {
    /// Adds `rows` of `N` numbers and returns the accessor's index. Rows of 16 are matrices, column after column.
    pub fn rows<T: Number, const N: usize>(&mut self, rows: &[[T; N]], target: Target) -> usize {
        let start = self.bytes.len();
        rows.as_flattened()
            .iter()
            .for_each(|number| number.put(&mut self.bytes));
        let view = self.view(start, target);
        let kind = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        self.accessors.push(json!({
            "bufferView": view, "componentType": T::CODE, "count": rows.len(), "type": kind,
        }));
        self.accessors.len() - 1
    }

    /// Adds rows as [`Numbers::rows`] does, with the minimum and maximum of each column, which glTF demands for positions and times.
    pub fn bounded<const N: usize>(&mut self, rows: &[[f32; N]], target: Target) -> usize {
        let accessor = self.rows(rows, target);
        let bound = |start: f32, choose: fn(f32, f32) -> f32| -> Vec<f32> {
            let column = |c: usize| rows.iter().map(|row| row[c]).fold(start, choose);
            (0..N).map(column).collect()
        };
        self.accessors[accessor]["min"] = json!(bound(f32::INFINITY, f32::min));
        self.accessors[accessor]["max"] = json!(bound(f32::NEG_INFINITY, f32::max));
        accessor
    }

    /// Adds an image file and returns the view's index.
    pub fn picture(&mut self, file: &[u8]) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(file);
        self.view(start, Target::Other)
    }

    /// Adds a view of the bytes from `start` on and returns its index. Pads the bytes to a multiple of four, as glTF
    /// demands.
    fn view(&mut self, start: usize, target: Target) -> usize {
        let mut view = json!({
            "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start,
        });
        match target {
            Target::Vertices => view["target"] = json!(34962),
            Target::Triangles => view["target"] = json!(34963),
            Target::Other => (),
        }
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Writes the file. `scene` is glTF's document without the accessors, views and buffer, which are added here.
    ///
    /// # Errors
    /// If writing fails, or the file has 4 GiB or more.
    pub fn write(self, mut scene: Value, to: &mut impl Write) -> io::Result<()> {
        scene["asset"] = json!({ "version": "2.0", "generator": "yoto" });
        scene["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        scene["bufferViews"] = self.views.into();
        scene["accessors"] = self.accessors.into();
        let mut text = scene.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = |bytes: usize| u32::try_from(bytes).map_err(io::Error::other);
        to.write_all(b"glTF")?;
        for number in [
            2,
            length(12 + 8 + text.len() + 8 + self.bytes.len())?,
            length(text.len())?,
        ] {
            to.write_all(&number.to_le_bytes())?;
        }
        to.write_all(b"JSON")?;
        to.write_all(&text)?;
        to.write_all(&length(self.bytes.len())?.to_le_bytes())?;
        to.write_all(b"BIN\0")?;
        to.write_all(&self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_found_by_their_lengths() {
        let mut numbers = Numbers::default();
        assert_eq!(numbers.rows(&[[1u8, 2, 3]], Target::Other), 0);
        assert_eq!(
            numbers.bounded(&[[1.0, -2.0], [0.5, 3.0]], Target::Vertices),
            1
        );
        let mut file = Vec::new();
        numbers
            .write(json!({ "scene": 0 }), &mut file)
            .expect("writes");
        let number =
            |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("4 bytes")) as usize;
        assert_eq!(number(8), file.len());
        let text: Value = serde_json::from_slice(&file[20..20 + number(12)]).expect("JSON");
        let start = 20 + number(12) + 8;
        assert_eq!(number(start - 8), file.len() - start);
        assert_eq!(&file[start..start + 4], &[1, 2, 3, 0]);
        assert_eq!(&file[start + 4..start + 8], &1f32.to_le_bytes());
        assert_eq!(text["accessors"][1]["min"], json!([0.5, -2.0]));
        assert_eq!(text["accessors"][1]["max"], json!([1.0, 3.0]));
        assert_eq!(
            text["bufferViews"][1],
            json!({
                "buffer": 0, "byteOffset": 4, "byteLength": 16, "target": 34962,
            })
        );
    }
}
