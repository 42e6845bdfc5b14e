//! The key with which reports are signed: Ed25519, in a file of the data folder that only the service's user can read. Each
//! coordinator has its own.

use ring::rand::SystemRandom;
use ring::signature::{Ed25519KeyPair, KeyPair};
use std::io::{Error, ErrorKind, Write};
use std::path::Path;
use yoto_process::private;
use yoto_proto::hex;
use yoto_store::SignedReport;

/// The file in the data folder: PKCS #8.
const FILE: &str = "erasure.key";

/// Signs the report with the key in `data_dir`, which is made if there is none.
///
/// # Errors
/// When the key can't be read or written.
pub(super) fn sign(data_dir: &Path, json: String) -> std::io::Result<SignedReport> {
    let pkcs8 = key(&data_dir.join(FILE))?;
    let pair = Ed25519KeyPair::from_pkcs8(&pkcs8);
    let pair = pair.map_err(|error| {
        let message =
            format!("{FILE} is no Ed25519 key ({error}): move it away, and another is made");
        Error::new(ErrorKind::InvalidData, message)
    })?;
    Ok(SignedReport {
        signature: hex(pair.sign(json.as_bytes()).as_ref()),
        public_key: hex(pair.public_key().as_ref()),
        json,
    })
}

/// The key in the file, or a new one.
fn key(path: &Path) -> std::io::Result<Vec<u8>> {
    match std::fs::read(path) {
        Ok(key) => return Ok(key),
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    let made = Ed25519KeyPair::generate_pkcs8(&SystemRandom::new());
    let made = made.map_err(|_| Error::other("the system has no random numbers"))?;
    let mut file = private::writable().create_new(true).open(path)?;
    file.write_all(made.as_ref())?;
    file.sync_all()?;
    Ok(made.as_ref().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ring::signature::{ED25519, UnparsedPublicKey};

    #[test]
    fn the_key_stays_and_its_signature_holds_for_the_report_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = sign(folder.path(), "{}".to_owned()).expect("signs");
        let again = sign(folder.path(), "{}".to_owned()).expect("signs");
        assert_eq!(first.public_key, again.public_key);
        let [key, signature] =
            [&first.public_key, &first.signature].map(|it| hex::decode(it).expect("hex"));
        let key = UnparsedPublicKey::new(&ED25519, key);
        key.verify(b"{}", &signature).expect("holds");
        key.verify(b"{ }", &signature)
            .expect_err("is of another report");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let file = std::fs::metadata(folder.path().join(FILE)).expect("is there");
            assert_eq!(file.permissions().mode() & 0o777, 0o600);
        }
        std::fs::write(folder.path().join(FILE), "no key").expect("writes");
        let error = sign(folder.path(), String::new()).expect_err("is no key");
        assert!(error.to_string().contains("move it away"), "{error}");
    }
}
