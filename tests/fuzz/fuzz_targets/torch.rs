//! A file of torch: data or an error, in bounded memory, and nothing is run.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_formats::rle::RunLengths;
use yoto_formats::torch;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(value) = torch::read(bytes, 1 << 24) {
        // What readers do with a value.
        let _ = value.numbers();
        let _ = value.get("smpl_params_incam");
        let _ = RunLengths::read(&value).map(|mask| mask.area());
    }
});
