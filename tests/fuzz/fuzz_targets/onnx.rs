//! A network in ONNX: the inputs and outputs of a matting model, or an error. The network is not run.
#![no_main]

// Private to its crate.
#[allow(dead_code)]
#[path = "../../../worker/matting/src/form.rs"]
mod form;

use form::Signature;
use libfuzzer_sys::fuzz_target;
use rten::Model;

/// Sides of the pictures that the network would get.
const SIDES: [[usize; 2]; 3] = [[1, 1], [96, 64], [8192, 8192]];

fuzz_target!(|bytes: &[u8]| {
    let Ok(model) = Model::load(bytes.to_vec()) else {
        return;
    };
    match Signature::of(&model) {
        Ok(signature) => {
            assert!(model.input_ids().contains(&signature.picture));
            for [width, height] in SIDES {
                let seen = signature.seen(width, height);
                assert!(seen.iter().all(|side| (1..=4096).contains(side)));
                assert!(Signature::ratio(seen) > 0.0);
            }
        }
        Err(message) => assert!(!message.is_empty()),
    }
});
