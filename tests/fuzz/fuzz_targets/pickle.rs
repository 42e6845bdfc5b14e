//! A pickle: data or an error, in bounded memory, and nothing is run.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(value) = yoto_formats::pickle::read(bytes) {
        // What readers do with a value.
        let _ = value.numbers();
        let _ = value.get("poses");
        let _ = value.kind();
    }
});
