//! Arrays in files of joblib: the pickle describes each array, and the array's bytes follow the instruction
//! that completes the description.

use super::PickleError;
use super::machine::{Id, Machine, Node};
use super::numpy::{RawArray, dtype, shape, text};
use super::storage::StorageBytes;
use crate::array::count;

/// The class of the descriptions.
pub(super) const WRAPPER: &str = "joblib.numpy_pickle.NumpyArrayWrapper";

/// Most fields of a description. Fields are searched one by one, and a few bytes of a file can refer to a
/// dictionary of any size.
const MAX_FIELDS: usize = 16;

/// Whether a node is a description without its fields yet.
pub(super) fn is_wrapper(node: &Node) -> bool {
    matches!(node, Node::Object(class, None) if **class == *WRAPPER)
}

/// The array with the description `state`, from the bytes that follow.
pub(super) fn array(machine: &mut Machine, state: Id) -> Result<Node, PickleError> {
    // Bounds the recursion: an array of objects is a pickle, which may have arrays of objects.
    if machine.nested {
        return Err(PickleError::Malformed(
            "an array of joblib in a pickle in a pickle",
        ));
    }
    let kind = dtype(field(machine, state, "dtype")?)?;
    if kind.is_object() {
        machine.nested = true;
        let root = machine.run_apart();
        machine.nested = false;
        return Ok(machine.node(root?)?.clone());
    }
    let shape = shape(machine, field(machine, state, "shape")?)?;
    let columns_first = match &*text(field(machine, state, "order")?)? {
        "C" => false,
        "F" => true,
        _ => return Err(PickleError::Malformed("an array's order is not C or F")),
    };
    // Joblib aligns the numbers since version 1.2.
    if let Ok(Node::Number(_)) = field(machine, state, "numpy_array_alignment_bytes") {
        let [padding] = machine.fixed::<1>()?;
        machine.take(usize::from(padding))?;
    }
    let size = kind.size().ok_or(PickleError::Malformed(
        "an array of neither integers, floats nor strings",
    ))?;
    let length = count(&shape).and_then(|count| count.checked_mul(size));
    let start = machine.at;
    machine.take(length.ok_or(PickleError::Truncated)?)?;
    Ok(Node::Array(RawArray {
        shape,
        dtype: kind,
        columns_first,
        data: StorageBytes::File(start..machine.at),
    }))
}

/// A field of the description.
fn field<'a>(machine: &'a Machine, state: Id, name: &str) -> Result<&'a Node, PickleError> {
    let entries = match machine.node(state)? {
        Node::Dict(entries) if entries.len() <= MAX_FIELDS => entries,
        _ => return Err(PickleError::Malformed("an array of joblib without fields")),
    };
    let named = entries
        .iter()
        .find(|(key, _)| matches!(machine.node(*key), Ok(Node::Text(key)) if **key == *name));
    let (_, value) = named.ok_or(PickleError::Malformed("an array of joblib lacks a field"))?;
    machine.node(*value)
}

#[cfg(test)]
mod tests {
    use super::super::tests::bytes;
    use super::super::{PickleError, read, read_without};
    use crate::{Array, Value};

    /// `{"a": arange(6, dtype="f4").reshape(2, 3), "o": array([1, "x"], object)}`, protocol 2.
    const PLAIN: &str = concat!(
        "80027d7100285801000000617101636a6f626c69622e6e756d70795f7069636b6c650a4e756d7079",
        "417272617957726170706572",
        "0a7102298171037d7104285808000000737562636c6173737105636e756d70790a6e646172726179",
        "0a71065805000000736861706571074b024b0386710858050000006f726465727109580100000043",
        "710a58050000006474797065710b636e756d70790a64747970650a710c58020000006634710d8988",
        "87710e52710f284b0358010000003c71104e4e4e4affffffff4affffffff4b0074711162580a0000",
        "00616c6c6f775f6d6d6170711288581b0000006e756d70795f61727261795f616c69676e6d656e74",
        "5f627974657371134b10756207ffffffffffffff000000000000803f000000400000404000008040",
        "0000a04058010000006f71146802298171157d7116286805680668074b028571176809680a680b68",
        "0c58020000004f387118898887711952711a284b0358010000007c711b4e4e4e4affffffff4affff",
        "ffff4b3f74711c6268128968134b10756280059590000000000000008c166e756d70792e5f636f72",
        "652e6d756c74696172726179948c0c5f7265636f6e7374727563749493948c056e756d7079948c07",
        "6e6461727261799493944b0085944301629487945294284b014b02859468038c0564747970659493",
        "948c024f3894898887945294284b038c017c944e4e4e4affffffff4affffffff4b3f749462895d94",
        "284b018c017894657494622e752e",
    );

    /// `{"a": asfortranarray(arange(6, dtype="i2").reshape(2, 3))}`, compressed with level 3.
    const PACKED: &str = concat!(
        "785e358eb16ec2401044d7361688344494f901d25050d3d0a4c8492ed2a4b4f6f0099c9cedd39dad",
        "c80512691290b663f9b87c0d9c0d996235a39da7ddfde0fc0737ed9802649a7e5452e7725e368569",
        "5393af3fb5627a4cbab8b216db778bc628cb277efee61dcf68e41ab9d6e81c53dc534cc332c3aeeb",
        "4b14bb2d1ac52214d18f4f95cd3c4cc18bf759ddfacd76f4ef7c3bcc177c3cfcf21bcf4444c19293",
        "2479bd78f54340cd92c6a875f59516051a3ed0d3edd3fe5e8a3adf94852aeb54b6b5722c268d7ce8",
        "c8bb002208600021c4e0e65775eb6936",
    );

    #[test]
    fn arrays_lie_between_the_instructions() {
        let value = read(&bytes(PLAIN)).expect("reads");
        let array = |values: [f64; 6]| Array {
            shape: vec![2, 3],
            values: values.to_vec(),
        };
        let expected = array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(value.get("a"), Some(&Value::Array(expected.clone())));
        let objects = Value::List(vec![Value::Number(1.0), Value::Text("x".into())]);
        assert_eq!(value.get("o"), Some(&objects));
        let packed = read(&bytes(PACKED)).expect("reads");
        assert_eq!(packed.get("a"), Some(&Value::Array(expected)));
        let less = read_without(&bytes(PLAIN), &["a"]).expect("reads");
        assert_eq!(less.get("a"), Some(&Value::Nothing));
        assert_eq!(less.get("o"), Some(&objects));
    }

    #[test]
    fn broken_files_are_errors() {
        let whole = bytes(PLAIN);
        for end in 0..whole.len() {
            assert!(read(&whole[..end]).is_err(), "{end}");
        }
        for at in 0..whole.len() {
            let mut broken = whole.clone();
            broken[at] ^= 0xff;
            // Any file must return.
            let _ = read(&broken);
        }
        // A shape of 2^31 × 3.
        let huge = PLAIN.replace("4b024b0386", "8a04000000404b0386");
        assert_eq!(
            read(&bytes(&huge)),
            Err(PickleError::Malformed("a shape with an invalid length"))
        );
        let long = PLAIN.replace("4b024b0386", "4affffff0f4b0386");
        assert_eq!(read(&bytes(&long)), Err(PickleError::Truncated));
    }
}
