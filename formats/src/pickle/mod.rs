//! Reads the data of a pickle and nothing else: numbers, texts, lists, dictionaries, numpy
//! arrays, and the fields of scipy's sparse matrices and chumpy's variables. A pickle is a program
//! that may call anything; this reader calls nothing. Where a file names a function, it accepts only
//! the few that describe such data. Protocols 0 to 5, of Python 2 and 3.

mod execute;
mod machine;
mod numpy;
mod text;
mod unfold;

use crate::Value;
use thiserror::Error;

/// Deepest nesting.
const MAX_DEPTH: usize = 32;
/// Most parts of a file.
const MAX_NODES: usize = 1 << 22;
/// Most values of the unfolded result: shared parts count each time, long texts several times.
const MAX_VALUES: usize = 1 << 22;
/// Most numbers in arrays of the unfolded result: shared arrays count each time.
const MAX_NUMBERS: usize = 1 << 26;
/// Longest name of a function, class or type, bytes.
const MAX_NAME: usize = 256;

/// Why a pickle can't be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PickleError {
    /// The file stops before its STOP.
    #[error("the pickle ends too early")]
    Truncated,
    /// An instruction that this reader lacks.
    #[error("the pickle has instruction 0x{0:02x}, which is not plain data")]
    Instruction(u8),
    /// A call that is not part of plain data.
    #[error("the pickle calls {0}, which is not plain data")]
    Call(String),
    /// Instructions that contradict each other, or numbers of an unknown type.
    #[error("the pickle is malformed: {0}")]
    Malformed(&'static str),
    /// More than any data of a capture or a body model can be.
    #[error("the pickle is nested too deeply or unfolds to too much")]
    TooLarge,
}

/// The data in `bytes`.
///
/// # Errors
/// When they are not a pickle of plain data.
pub fn read(bytes: &[u8]) -> Result<Value, PickleError> {
    let mut machine = machine::Machine::new(bytes);
    let root = machine.run()?;
    machine.unfold(root)
}

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

    fn bytes(hex: &str) -> Vec<u8> {
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
    }
}
