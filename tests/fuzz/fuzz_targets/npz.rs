//! A `.npz`: arrays or an error, and never more bytes than the limit.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = yoto_formats::npz::read(bytes, 1 << 22);
});
