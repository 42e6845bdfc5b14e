//! Reads only data from a pickle: numbers, texts, bytes, lists, dictionaries, numpy arrays, torch tensors, and
//! the fields of scipy's sparse matrices and chumpy's variables.
//!
//! A pickle is a program that may call any function; this reader calls none. If a file names a function, it must be
//! one of the few that describe such data. Protocols 0 to 5 of Python 2 and 3 are supported, and files of joblib, with
//! and without compression.

mod budget;
mod execute;
mod joblib;
mod legacy;
mod machine;
mod numpy;
mod storage;
mod text;
mod unfold;
mod unpack;

use crate::Value;
use std::borrow::Cow;
use thiserror::Error;

/// Deepest nesting.
const MAX_DEPTH: usize = 32;
/// Most parts of a file.
const MAX_NODES: usize = 1 << 22;
/// Most values of the unfolded result. Shared parts count each time, and long texts several times.
const MAX_VALUES: usize = 1 << 22;
/// Most numbers in arrays of the unfolded result. Shared arrays count each time.
const MAX_NUMBERS: usize = 1 << 26;
/// Most bytes created by calls, as Python 3 writes bytes for Python 2, and of pickles inside a pickle.
const MAX_ENCODED: usize = 1 << 28;
/// Most numbers of tensors beyond those of their storages, by repetition.
const MAX_EXPANDED: usize = 1 << 20;
/// Most bytes that a compressed file may unpack to.
const MAX_UNPACKED: u64 = 1 << 30;
/// Longest name of a function, class or type, bytes.
const MAX_NAME: usize = 256;

/// Why a pickle can't be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PickleError {
    /// The file ends before its STOP instruction.
    #[error("the pickle ends too early")]
    Truncated,
    /// An unsupported instruction.
    #[error("the pickle has instruction 0x{0:02x}, which is not plain data")]
    Instruction(u8),
    /// A call that is not part of plain data.
    #[error("the pickle calls {0}, which is not plain data")]
    Call(String),
    /// Instructions that contradict each other, or numbers of an unknown type.
    #[error("the pickle is malformed: {0}")]
    Malformed(&'static str),
    /// More data than any capture or body model has.
    #[error("the pickle is nested too deeply or unfolds to too much")]
    TooLarge,
    /// A file of joblib with a compression other than zlib or gzip.
    #[error("the pickle is compressed with {0}: write it again with zlib or without compression")]
    Compression(&'static str),
    /// The compressed data are invalid.
    #[error("the compressed pickle is damaged: {0}")]
    Damaged(String),
    /// A few kilobytes can unpack to any size.
    #[error("the compressed pickle unpacks to more than {0} bytes")]
    Unpacked(u64),
}

/// The data in `bytes`: a pickle, or a file of joblib.
///
/// # Errors
/// If the bytes are not a pickle of plain data, or unpack to over 1 GiB.
pub fn read(bytes: &[u8]) -> Result<Value, PickleError> {
    read_without(bytes, &[])
}

/// Reads as [`read`] does, with [`Value::Nothing`] for every dictionary value with a key in `without`, so that a reader of joints
/// need not hold meshes with thousands of vertices per frame.
///
/// # Errors
/// The same errors as [`read`].
pub fn read_without(bytes: &[u8], without: &[&str]) -> Result<Value, PickleError> {
    read_within(bytes, without, &mut Budget::default())
}

/// Reads as [`read_without`] does, for one of several pickles in a file, which share `budget`.
///
/// # Errors
/// The same errors as [`read`].
pub(crate) fn read_within(
    bytes: &[u8],
    without: &[&str],
    budget: &mut Budget,
) -> Result<Value, PickleError> {
    let bytes = unpack::unpacked(bytes, budget.unpacked)?;
    if let Cow::Owned(unpacked) = &bytes {
        budget.unpacked -= unpacked.len() as u64;
    }
    let mut machine = machine::Machine::new(&bytes);
    machine.without = without;
    let root = machine.run()?;
    machine.unfold_within(root, budget)
}

pub(crate) use budget::Budget;
pub(crate) use legacy::{MAGIC, read as read_legacy};
pub(crate) use storage::read as read_with_storages;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Array;

    fn array(shape: &[usize], values: &[f64]) -> Array {
        Array {
            shape: shape.to_vec(),
            values: values.to_vec(),
        }
    }

    /// The bytes of hexadecimal digits.
    pub(super) fn bytes(hex: &str) -> Vec<u8> {
        (0..hex.len() / 2)
            .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).expect("hex"))
            .collect()
    }

    /// `{"joints": numpy.arange(6, dtype="f4").reshape(2, 3)}` by numpy 2, protocol 4.
    const ARRAY: &str = concat!(
        "800495af000000000000007d948c066a6f696e7473948c166e756d70792e5f636f72652e",
        "6d756c74696172726179948c0c5f7265636f6e7374727563749493948c056e756d707994",
        "8c076e6461727261799493944b0085944301629487945294284b014b024b03869468058c",
        "0564747970659493948c02663494898887945294284b038c013c944e4e4e4affffffff4a",
        "ffffffff4b00749462894318000000000000803f00000040000040400000804000",
        "00a04094749462732e",
    );

    #[test]
    fn arrays_and_lists_are_numbers() {
        let value = read(&bytes(ARRAY)).expect("a pickle");
        let joints = value.get("joints").expect("the key");
        let expected: Vec<f64> = (0..6).map(f64::from).collect();
        assert_eq!(joints.numbers(), Some(array(&[2, 3], &expected)));
        // [[1, 2.5], [3, 4]], protocol 2.
        let lists = bytes("80025d7100285d7101284b01474004000000000000655d7102284b034b0465652e");
        assert_eq!(
            read(&lists).expect("lists").numbers(),
            Some(array(&[2, 2], &[1.0, 2.5, 3.0, 4.0]))
        );
    }

    /// `defaultdict(list, k=[b"\xff\0", float32(1.5)], p=PurePosixPath("/a/b.jpg"))`, protocol 4.
    const MIXED: &str = concat!(
        "800495df000000000000008c0b636f6c6c656374696f6e73948c0b64656661756c74646963749493",
        "948c086275696c74696e73948c046c69737494939485945294288c016b945d94284302ff00948c16",
        "6e756d70792e5f636f72652e6d756c74696172726179948c067363616c61729493948c056e756d70",
        "79948c0564747970659493948c02663494898887945294284b038c013c944e4e4e4affffffff4aff",
        "ffffff4b0074946243040000c03f9486945294658c0170948c07706174686c6962948c0d50757265",
        "506f736978506174689493948c012f948c0161948c05622e6a70679487945294752e",
    );

    #[test]
    fn bytes_scalars_and_paths_are_data() {
        let value = read(&bytes(MIXED)).expect("reads");
        let items = [Value::Bytes(vec![0xff, 0]), Value::Number(1.5)];
        assert_eq!(
            value.get("k").and_then(Value::items),
            Some(items.as_slice())
        );
        assert_eq!(value.get("p").and_then(Value::text), Some("/a/b.jpg"));
    }

    #[test]
    fn nothing_is_called() {
        // os.system("true"), protocol 2.
        let call = bytes("8002636f730a73797374656d0a580400000074727565855271002e");
        assert_eq!(read(&call), Err(PickleError::Call("os.system".into())));
    }

    #[test]
    fn broken_files_are_errors() {
        let whole = bytes(ARRAY);
        for end in 0..whole.len() {
            assert!(read(&whole[..end]).is_err(), "{end}");
        }
        for at in 0..whole.len() {
            let mut broken = whole.clone();
            broken[at] ^= 0xff;
            // Any file must return.
            let _ = read(&broken);
        }
        // A list that contains itself.
        assert_eq!(
            read(&bytes("80025d71006800612e")),
            Err(PickleError::TooLarge)
        );
        // A million lists in each other.
        let deep = [vec![b']'; 1 << 20], vec![b'a'; (1 << 20) - 1], vec![b'.']].concat();
        assert_eq!(read(&deep), Err(PickleError::TooLarge));
    }
}
