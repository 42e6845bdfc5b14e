//! Elements of Matroska and WebM (RFC 8794, RFC 9559).

use super::{Container, length, read, write, zero};
use std::io;

const HEADER: u32 = 0x1a45_dfa3;
const SEGMENT: u32 = 0x1853_8067;
/// Tags, and attached files such as covers.
const TAGS: [u32; 2] = [0x1254_c367, 0x1941_a469];
/// An element that says nothing.
const VOID: u8 = 0xec;
/// Shortest element whose size is written in eight bytes.
const WIDE: u64 = 9;

/// An element from `start` to `end`, with its content from `body` on.
struct Element {
    id: u32,
    start: u64,
    body: u64,
    end: u64,
}

pub(super) fn remove(file: &mut impl Container) -> io::Result<()> {
    let end = length(file)?;
    let mut at = 0;
    while let Some(element) = element(file, at, end)? {
        match element.id {
            HEADER => at = element.end,
            SEGMENT => at = element.body,
            id => {
                at = element.end;
                if TAGS.contains(&id) {
                    blank(file, &element)?;
                }
            }
        }
    }
    Ok(())
}

/// The element at `at`; `None` at the end, or if there is none.
fn element(file: &mut impl Container, at: u64, limit: u64) -> io::Result<Option<Element>> {
    let Some([first]) = read::<1>(file, at)? else {
        return Ok(None);
    };
    let bytes = u64::from(first.leading_zeros()) + 1;
    if bytes > 4 {
        return Ok(None);
    }
    let mut id = 0;
    for place in 0..bytes {
        let Some([byte]) = read::<1>(file, at + place)? else {
            return Ok(None);
        };
        id = id << 8 | u32::from(byte);
    }
    let sized = at + bytes;
    let Some([first]) = read::<1>(file, sized)? else {
        return Ok(None);
    };
    let bytes = u64::from(first.leading_zeros()) + 1;
    if bytes > 8 {
        return Ok(None);
    }
    let mut size = u64::from(first) & ((1 << (8 - bytes)) - 1);
    for place in 1..bytes {
        let Some([byte]) = read::<1>(file, sized + place)? else {
            return Ok(None);
        };
        size = size << 8 | u64::from(byte);
    }
    let body = sized + bytes;
    // All ones: as long as the file, or, of a cluster, unknown.
    let unknown = size == (1 << (7 * bytes)) - 1;
    let end = match unknown {
        true => limit,
        false => body.saturating_add(size),
    };
    let whole = end <= limit && (!unknown || id == SEGMENT);
    Ok(whole.then_some(Element {
        id,
        start: at,
        body,
        end,
    }))
}

/// Makes an element one that says nothing.
fn blank(file: &mut impl Container, element: &Element) -> io::Result<()> {
    let bytes = element.end - element.start;
    let mut head = vec![VOID];
    match bytes < WIDE {
        true => head.push(0x80 | (bytes - 2) as u8),
        false => {
            let size = (bytes - WIDE) | 1 << 56;
            head.extend(size.to_be_bytes());
        }
    }
    write(file, element.start, &head)?;
    zero(file, element.start + head.len() as u64, element.end)
}

#[cfg(test)]
mod tests {
    use crate::video::tags::tests::{has, removed};

    fn element(id: &[u8], content: &[u8]) -> Vec<u8> {
        let size = (content.len() as u16 | 0x4000).to_be_bytes();
        [id, &size, content].concat()
    }

    #[test]
    fn tags_become_void_and_the_rest_stays() {
        let inside = [
            element(&[0x15, 0x49, 0xa9, 0x66], b"info"),
            element(&[0x12, 0x54, 0xc3, 0x67], b"LOCATION +48.1374"),
            element(&[0x1f, 0x43, 0xb6, 0x75], b"PICTURE!"),
            element(&[0x12, 0x54, 0xc3, 0x67], b"x"),
        ]
        .concat();
        let header = element(&[0x1a, 0x45, 0xdf, 0xa3], b"webm");
        for segment in [
            element(&[0x18, 0x53, 0x80, 0x67], &inside),
            // Of unknown size, as a live film has.
            [
                &[
                    0x18, 0x53, 0x80, 0x67, 0x01, 255, 255, 255, 255, 255, 255, 255,
                ][..],
                &inside,
            ]
            .concat(),
        ] {
            let film = [&header[..], &segment].concat();
            let after = removed(&film);
            assert!(has(&film, b"+48.1374") && !has(&after, b"+48.1374"));
            assert!(!has(&after, &[0x12, 0x54, 0xc3, 0x67]));
            assert!(has(&after, b"PICTURE!") && has(&after, b"info"));
            assert_eq!(removed(&after), after, "is still whole");
        }
        for length in 0..header.len() + 60 {
            let film = [&header[..], &element(&[0x18, 0x53, 0x80, 0x67], &inside)].concat();
            removed(&film[..length.min(film.len())]);
        }
    }
}
