//! Reading a `.npy` gives an array whose length matches its shape, or an error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_formats::Value;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(Value::Array(array)) = yoto_formats::npy::read(bytes) {
        let count: usize = array.shape.iter().product();
        assert_eq!(count, array.values.len());
    }
});
