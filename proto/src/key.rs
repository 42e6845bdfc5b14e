//! A caller's key, on its way to the service.
//!
//! A key is a secret: it is no argument of a command, is in no URL, and is not printed by `Debug`. It travels in the header
//! `authorization`, marked as sensitive so that HTTP/2 keeps it out of its tables.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::Channel;
use tonic::{Request, Status};

/// The beginning of every key, by which scanners of leaked secrets find it.
pub const PREFIX: &str = "yoto_";
/// The header of a key.
pub const HEADER: &str = "authorization";
/// What the header has before the key.
pub const SCHEME: &str = "Bearer ";
/// Hexadecimal digits behind the prefix.
const DIGITS: usize = 64;

/// A connection whose calls have the caller's key, if there is one.
pub type Connection = InterceptedService<Channel, Caller>;

/// A key as the service has given it.
#[derive(Clone)]
pub struct Key(MetadataValue<Ascii>);

/// The text is not a key. It is not repeated: it may be one with a typing error.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("a key is {PREFIX} and {DIGITS} hexadecimal digits, as `yoto key create` has printed it")]
pub struct KeyError;

impl FromStr for Key {
    type Err = KeyError;

    fn from_str(text: &str) -> Result<Self, KeyError> {
        if !is_key(text) {
            return Err(KeyError);
        }
        let value = format!("{SCHEME}{text}").parse();
        let mut value: MetadataValue<Ascii> = value.map_err(|_| KeyError)?;
        value.set_sensitive(true);
        Ok(Self(value))
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key")
    }
}

/// Whether `text` has the form of a key.
pub fn is_key(text: &str) -> bool {
    let hex = |it: u8| matches!(it, b'0'..=b'9' | b'a'..=b'f');
    let digits = text.strip_prefix(PREFIX);
    digits.is_some_and(|digits| digits.len() == DIGITS && digits.bytes().all(hex))
}

/// Adds a key to calls.
#[derive(Debug, Clone, Default)]
pub struct Caller(Option<Key>);

impl Interceptor for Caller {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(Key(value)) = &self.0 {
            request.metadata_mut().insert(HEADER, value.clone());
        }
        Ok(request)
    }
}

/// `channel`, whose calls are made with `key`.
pub fn connection(channel: Channel, key: Option<Key>) -> Connection {
    InterceptedService::new(channel, Caller(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_in_the_header_and_is_not_shown() {
        let text = format!("{PREFIX}{}", "0f".repeat(32));
        let key: Key = text.parse().expect("a key");
        assert!(!format!("{key:?}").contains("0f0f"));
        let caller = Caller(Some(key));
        assert!(!format!("{caller:?}").contains("0f0f"));
        let request = caller.clone().call(Request::new(())).expect("is sent");
        let sent = request.metadata().get(HEADER).expect("has it");
        assert_eq!(sent.to_str().expect("text"), format!("Bearer {text}"));
        assert!(sent.is_sensitive() && !format!("{request:?}").contains("0f0f"));
    }

    #[test]
    fn what_is_no_key_is_refused_and_not_repeated() {
        let long = format!("{PREFIX}{}", "0f".repeat(33));
        for bad in ["", "yoto_", "secret", &long, &long.to_uppercase()] {
            let error = bad.parse::<Key>().expect_err("is refused").to_string();
            assert!(
                bad.is_empty() || bad == "yoto_" || !error.contains(bad),
                "{error}"
            );
        }
    }
}
