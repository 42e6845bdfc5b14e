//! Input and output files.

use super::{Archive, case, changed, checkpoint, model};
use burn::tensor::{bf16, f16};
use safetensors::SafeTensors;
use std::path::Path;
use yoto_avatar::import::{HumanNerfOptions, ImportError, import_humannerf};
use yoto_proto::manifest::files;

/// The error of an import of these files.
fn fault(checkpoint: &Path, joints: &Path) -> ImportError {
    let out = tempfile::tempdir().expect("a folder");
    let options = HumanNerfOptions::default();
    import_humannerf(checkpoint, joints, out.path(), &options).expect_err("must fail")
}

#[test]
fn what_does_not_fit_is_named() {
    let (tar, joints) = (checkpoint(), case().join("canonical_joints.pkl"));
    let other_name = |archive: &mut Archive| {
        archive.edit_pickle(b"output_linear.0.bias", b"Output_linear.0.bias");
    };
    let (_dir, broken) = changed(other_name);
    let error = fault(&broken, &joints);
    assert!(matches!(error, ImportError::Tensors { .. }), "{error}");
    let error = error.to_string();
    assert!(
        error.contains("cnl_mlp.output_linear.0.bias is missing"),
        "{error}"
    );
    let error = fault(&joints, &joints).to_string();
    assert!(error.contains("canonical_joints.pkl"), "{error}");
    let error = fault(&tar, &tar).to_string();
    assert!(error.contains("checkpoint.tar"), "{error}");
}

#[test]
fn a_file_without_networks_is_told_from_one_that_does_not_fit() {
    let joints = case().join("canonical_joints.pkl");
    // Pickles of {} and of {"network": {}}.
    let no_dict = b"\x80\x02}.".as_slice();
    let no_tensors = b"\x80\x02}X\x07\x00\x00\x00network}s.".as_slice();
    for pickle in [no_dict, no_tensors] {
        let (_dir, empty) = changed(|archive| archive.0[0].1 = pickle.to_vec());
        let error = fault(&empty, &joints);
        assert!(matches!(error, ImportError::NoNetwork { .. }), "{error}");
        let error = error.to_string();
        assert!(
            error.contains("changed.tar holds no network: it has no tensors"),
            "{error}"
        );
    }
    let other_key =
        |archive: &mut Archive| archive.edit_pickle(b"\x07\0\0\0network", b"\x07\0\0\0NETWORK");
    let (_dir, foreign) = changed(other_key);
    let error = fault(&foreign, &joints).to_string();
    for part in ["holds no network", "none of its 56 tensors", "'NETWORK."] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn half_precision_is_read_as_it_is() {
    let options = HumanNerfOptions::default();
    let numbers = |checkpoint: &Path| -> Vec<f32> {
        let model = model(checkpoint, &options);
        let bytes = std::fs::read(model.path().join(files::WEIGHTS)).expect("written");
        let weights = SafeTensors::deserialize(&bytes).expect("safetensors");
        let mut tensors = weights.tensors();
        tensors.sort_by(|(one, _), (other, _)| one.cmp(other));
        let bytes = tensors.iter().flat_map(|(_, tensor)| {
            let (numbers, _) = tensor.data().as_chunks::<4>();
            numbers.to_vec()
        });
        bytes.map(f32::from_le_bytes).collect()
    };
    let whole = numbers(&checkpoint());
    let (_dir, half) = changed(|archive| {
        archive.narrow("HalfStorage", |v| f16::from_f32(v).to_le_bytes());
    });
    let expected: Vec<f32> = whole.iter().map(|v| f16::from_f32(*v).to_f32()).collect();
    assert!(numbers(&half) == expected && expected != whole, "float16");
    let (_dir, half) = changed(|archive| {
        archive.narrow("BFloat16Storage", |v| bf16::from_f32(v).to_le_bytes());
    });
    let expected: Vec<f32> = whole.iter().map(|v| bf16::from_f32(*v).to_f32()).collect();
    assert!(numbers(&half) == expected, "bfloat16");
}

#[test]
fn the_same_checkpoint_gives_the_same_files() {
    let written = || {
        let model = model(&checkpoint(), &HumanNerfOptions::default());
        [files::WEIGHTS, files::STATE]
            .map(|name| std::fs::read(model.path().join(name)).expect("written"))
    };
    let first = written();
    // An unspecified order is unlikely to be the same every time.
    for _ in 0..6 {
        assert!(written() == first);
    }
}

#[cfg(unix)]
#[test]
fn weights_may_be_read_by_whoever_may_read_the_state() {
    use std::os::unix::fs::PermissionsExt;
    let model = model(&checkpoint(), &HumanNerfOptions::default());
    let mode = |name: &str| {
        let file = std::fs::metadata(model.path().join(name)).expect("written");
        file.permissions().mode()
    };
    assert_eq!(mode(files::WEIGHTS), mode(files::STATE));
}
