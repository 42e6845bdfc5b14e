//! Chunks of AVI.

use super::{Container, length, read, write, zero};
use std::io;

/// Bytes of a chunk before its content.
const HEAD: u64 = 8;

pub(super) fn remove(file: &mut impl Container) -> io::Result<()> {
    let limit = length(file)?;
    let mut at = 12;
    while let Some(head) = read::<12>(file, at)? {
        let [a, b, c, d, e, f, g, h, list @ ..] = head;
        let size = u64::from(u32::from_le_bytes([e, f, g, h]));
        let end = at + HEAD + size;
        if end > limit {
            break;
        }
        let kind = [a, b, c, d];
        if (&kind, &list) == (b"LIST", b"INFO") || &kind == b"IDIT" {
            write(file, at, b"JUNK")?;
            zero(file, at + HEAD, end)?;
        }
        // Chunks begin at even places.
        at = end + size % 2;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::video::tags::tests::{has, removed};

    fn chunk(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        let size = (content.len() as u32).to_le_bytes();
        let pad = vec![0; content.len() % 2];
        [&kind[..], &size, content, &pad].concat()
    }

    #[test]
    fn information_becomes_junk_and_the_rest_stays() {
        let inside = [
            chunk(b"LIST", b"hdrlheader!"),
            chunk(b"LIST", b"INFOIGPSby Ada"),
            chunk(b"LIST", b"moviPICTURE!"),
        ]
        .concat();
        let film = chunk(b"RIFF", &[&b"AVI "[..], &inside].concat());
        let after = removed(&film);
        assert!(has(&film, b"Ada") && !has(&after, b"Ada"));
        assert!(has(&after, b"PICTURE!") && has(&after, b"header!") && has(&after, b"JUNK"));
        for length in 0..film.len() {
            removed(&film[..length]);
        }
    }
}
