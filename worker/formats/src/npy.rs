//! `.npy`: one array, in the format of `numpy.save`.
//!
//! No library reads the header, because pickles contain the same element types, and arrays of objects
//! (`allow_pickle=True`) need [`pickle`].

use crate::array::{count, rows_first};
use crate::dtype::Dtype;
use crate::pickle::{self, Budget, PickleError};
use crate::{Array, Value};
use thiserror::Error;

/// Magic bytes of every file.
const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header, bytes. By default numpy refuses longer ones too.
const MAX_HEADER: usize = 10_000;

/// Why a `.npy` can't be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NpyError {
    /// Not numpy's format at all.
    #[error("not a .npy file: it does not begin with \\x93NUMPY")]
    Magic,
    /// The file stops inside the header.
    #[error("the .npy file ends inside its header")]
    Truncated,
    /// The header does not describe an array.
    #[error("the .npy header is malformed: {0}")]
    Header(&'static str),
    /// Complex numbers, structures, dates.
    #[error("elements of type {0} are neither integers, floats, strings nor objects")]
    Type(String),
    /// There are fewer or more bytes than elements.
    #[error("{found} bytes of elements, but the shape {shape:?} needs {needed}")]
    Size {
        /// Bytes after the header.
        found: usize,
        /// Extents in the header.
        shape: Vec<usize>,
        /// Bytes of an array of that shape.
        needed: String,
    },
    /// The objects of an array of objects.
    #[error("array of objects: {0}")]
    Pickle(#[from] PickleError),
}

/// The array in `bytes`: numbers as [`Value::Array`], strings as a list, objects as their values. An array of objects
/// without axes is returned as its only element.
///
/// # Errors
/// If the bytes are not a valid file.
pub fn read(bytes: &[u8]) -> Result<Value, NpyError> {
    read_without(bytes, &[])
}

/// Reads as [`read`] does, with [`Value::Nothing`] for dictionary values with keys in `without`.
///
/// # Errors
/// The same errors as [`read`].
pub fn read_without(bytes: &[u8], without: &[&str]) -> Result<Value, NpyError> {
    read_within(bytes, without, &mut Budget::default())
}

/// Reads as [`read_without`] does, for one of several arrays in a file; their pickles share `budget`.
///
/// # Errors
/// The same errors as [`read`].
pub(crate) fn read_within(
    bytes: &[u8],
    without: &[&str],
    budget: &mut Budget,
) -> Result<Value, NpyError> {
    let (header, rest) = split(bytes)?;
    let code = quoted(field(header, "descr")?).ok_or_else(|| {
        let code = field(header, "descr").unwrap_or_default();
        NpyError::Type(code.chars().take(40).collect())
    })?;
    let dtype = Dtype::new(code);
    if dtype.is_object() {
        return Ok(pickle::read_within(rest, without, budget)?);
    }
    let shape = shape(field(header, "shape")?)?;
    let columns_first = field(header, "fortran_order")?.starts_with("True");
    let size = dtype.size().ok_or_else(|| NpyError::Type(code.into()))?;
    let needed = count(&shape).and_then(|count| count.checked_mul(size));
    if needed != Some(rest.len()) {
        return Err(NpyError::Size {
            found: rest.len(),
            shape,
            needed: needed.map_or("more than there can be".into(), |bytes| bytes.to_string()),
        });
    }
    if let Some(texts) = dtype.texts(rest) {
        return Ok(Value::List(texts));
    }
    let values = dtype
        .numbers(rest)
        .ok_or_else(|| NpyError::Type(code.into()))?;
    Ok(Value::Array(Array {
        values: if columns_first {
            rows_first(&shape, values)
        } else {
            values
        },
        shape,
    }))
}

/// The header's text, and the bytes after it.
fn split(bytes: &[u8]) -> Result<(&str, &[u8]), NpyError> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(NpyError::Magic)?;
    let (&[major, _], rest) = rest.split_first_chunk().ok_or(NpyError::Truncated)?;
    let (length, rest) = if major == 1 {
        let (length, rest) = rest.split_first_chunk().ok_or(NpyError::Truncated)?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk().ok_or(NpyError::Truncated)?;
        (u32::from_le_bytes(*length) as usize, rest)
    };
    if length > MAX_HEADER {
        return Err(NpyError::Header("too long for an array"));
    }
    let (header, rest) = rest.split_at_checked(length).ok_or(NpyError::Truncated)?;
    let header = str::from_utf8(header).map_err(|_| NpyError::Header("not text"))?;
    Ok((header, rest))
}

/// The text after `'name':`. The header is a Python dictionary, written by numpy.
fn field<'a>(header: &'a str, name: &'static str) -> Result<&'a str, NpyError> {
    let missing = NpyError::Header(match name {
        "descr" => "no descr",
        "shape" => "no shape",
        _ => "no fortran_order",
    });
    let at = header.find(&format!("'{name}'")).ok_or(missing.clone())?;
    let rest = header.get(at + name.len() + 2..).ok_or(missing.clone())?;
    let value = rest.trim_start().strip_prefix(':').ok_or(missing)?;
    Ok(value.trim_start())
}

/// A string in quotes; `None` for structures, which are lists.
fn quoted(value: &str) -> Option<&str> {
    let quote = value.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    value.get(1..)?.split(quote).next()
}

fn shape(value: &str) -> Result<Vec<usize>, NpyError> {
    const BAD: NpyError = NpyError::Header("a shape that is not a tuple of lengths");
    let inside = value
        .strip_prefix('(')
        .and_then(|rest| rest.split_once(')'));
    let (sides, _) = inside.ok_or(BAD)?;
    let sides: Vec<usize> = sides
        .split(',')
        .map(|side| side.trim().trim_end_matches('L'))
        .filter(|side| !side.is_empty())
        .map(|side| side.parse().map_err(|_| BAD))
        .collect::<Result<_, _>>()?;
    if sides.len() > 32 {
        return Err(NpyError::Header("more axes than numpy allows"));
    }
    Ok(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn both_orders_are_rows_first() {
        let data: Vec<u8> = [1f32, 4.0, 2.0, 5.0, 3.0, 6.0]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let header = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }\n";
        let expected = Array {
            shape: vec![2, 3],
            values: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        };
        assert_eq!(read(&file(header, &data)), Ok(Value::Array(expected)));
        let header = header.replace("(2, 3)", "(6,)").replace("True", "False");
        let flat = read(&file(&header, &data)).expect("reads").numbers();
        assert_eq!(flat.expect("numbers").values[1], 4.0);
    }

    #[test]
    fn lies_are_errors() {
        let header = |descr: &str, shape: &str| {
            format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}")
        };
        let of = |descr, shape, data: &[u8]| read(&file(&header(descr, shape), data));
        assert!(matches!(
            of("'<f8'", "(2,)", &[0; 15]),
            Err(NpyError::Size { .. })
        ));
        let endless = "(4000000000, 4000000000, 4000000000)";
        assert!(matches!(
            of("'<f8'", endless, &[0; 8]),
            Err(NpyError::Size { .. })
        ));
        assert!(matches!(
            of("'<c16'", "(1,)", &[0; 16]),
            Err(NpyError::Type(_))
        ));
        assert!(matches!(
            of("[('a', '<f4')]", "(1,)", &[0; 4]),
            Err(NpyError::Type(_))
        ));
        assert!(matches!(
            of("'<f8'", "(-1,)", &[]),
            Err(NpyError::Header(_))
        ));
        assert!(matches!(of("'|O'", "()", &[]), Err(NpyError::Pickle(_))));
        assert_eq!(read(b"PK"), Err(NpyError::Magic));
        let whole = file(&header("'<f8'", "(2,)"), &[0; 16]);
        for end in 0..whole.len() {
            assert!(read(&whole[..end]).is_err(), "{end}");
        }
    }
}
