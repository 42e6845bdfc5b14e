//! Reads a network from its file, within a time.

use rten::Model;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Longest time to read a file. The parser of some damaged files has no end (`tests/fuzz`); the largest whole one takes seconds.
const PATIENCE: Duration = Duration::from_secs(180);

/// The network of an ONNX file.
///
/// # Errors
/// In words, when the file can't be run, or is not read in time.
pub(crate) fn network(path: &Path) -> Result<Model, String> {
    let file = path.to_owned();
    within(PATIENCE, move || {
        Model::load_file(&file).map_err(|error| {
            format!(
                "is not an ONNX file that can be run: {error} (whole 32-bit floats are needed, and operators \
                 that rten knows)"
            )
        })
    })
}

/// What `read` returns. It runs on a thread of its own, which is left to itself after `patience`: the caller ends with the error.
fn within<T: Send + 'static>(
    patience: Duration,
    read: impl FnOnce() -> Result<T, String> + Send + 'static,
) -> Result<T, String> {
    let (tell, told) = channel();
    std::thread::spawn(move || tell.send(read()));
    match told.recv_timeout(patience) {
        Ok(read) => read,
        Err(RecvTimeoutError::Timeout) => Err(format!(
            "can't be read within {} s: is the file whole?",
            patience.as_secs_f64()
        )),
        Err(RecvTimeoutError::Disconnected) => Err("has made its parser fail".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_without_an_end_is_given_up() {
        let (keep, kept) = channel::<()>();
        let error = within(Duration::from_millis(20), move || Ok(kept.recv()));
        let error = error.expect_err("nothing is read");
        assert!(error.contains("can't be read within 0.02 s"), "{error}");
        drop(keep);
        let error = within::<()>(PATIENCE, || panic!("as a parser may"));
        assert!(error.expect_err("it fails").contains("parser fail"));
        assert_eq!(within(PATIENCE, || Ok(1)), Ok(1));
    }
}
