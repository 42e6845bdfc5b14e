//! Names of archive entries.

use crate::MediaFault;

/// Longest name, bytes.
const MAX_BYTES: usize = 400;

/// The entry's name, if it is a path inside its archive. `None` for folders, and for files that file
/// managers add.
///
/// # Errors
/// `BAD_NAME` if it is not UTF-8, too long, or has control characters; `UNSAFE_PATH` if it leads outside.
pub(super) fn checked(raw: &[u8]) -> Result<Option<String>, MediaFault> {
    let shown = || -> String { String::from_utf8_lossy(raw).chars().take(80).collect() };
    let refuse = |code, message: &str| Err(MediaFault::new(code, message).in_field(shown()));
    let Ok(name) = std::str::from_utf8(raw) else {
        return refuse("BAD_NAME", "the name of this entry is not UTF-8");
    };
    if name.len() > MAX_BYTES {
        return refuse("BAD_NAME", "the name of this entry is too long");
    }
    if name.chars().any(char::is_control) {
        return refuse("BAD_NAME", "the name of this entry has control characters");
    }
    if name.starts_with('/') || name.contains('\\') || name.as_bytes().get(1) == Some(&b':') {
        return refuse(
            "UNSAFE_PATH",
            "the name of this entry is not a relative path",
        );
    }
    let name = name.strip_prefix("./").unwrap_or(name);
    if name.is_empty() || name.ends_with('/') {
        return folder(name).map_or_else(|| refuse("UNSAFE_PATH", OUTSIDE), |()| Ok(None));
    }
    if name.split('/').any(|part| matches!(part, "" | "." | "..")) {
        return refuse("UNSAFE_PATH", OUTSIDE);
    }
    let own = name.rsplit('/').next().unwrap_or_default();
    let added = name.starts_with("__MACOSX/") || own.starts_with("._") || own == ".DS_Store";
    Ok((!added).then(|| name.to_owned()))
}

const OUTSIDE: &str = "the name of this entry has empty parts, '.' or '..'";

fn folder(name: &str) -> Option<()> {
    let inside = |part: &str| !matches!(part, "" | "." | "..");
    let name = name.trim_end_matches('/');
    (name.is_empty() || name.split('/').all(inside)).then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tricks_are_refused_and_litter_is_passed_over() {
        for good in ["frames/000001.png", "./a/b", "ü/ 1.png"] {
            assert!(checked(good.as_bytes()).expect(good).is_some());
        }
        for litter in [
            "frames/",
            "./",
            "__MACOSX/frames/._1.png",
            "a/._1.png",
            ".DS_Store",
        ] {
            assert_eq!(checked(litter.as_bytes()).expect(litter), None);
        }
        for (bad, code) in [
            (&b"../poses.json"[..], "UNSAFE_PATH"),
            (b"frames/../../x", "UNSAFE_PATH"),
            (b"../", "UNSAFE_PATH"),
            (b"/etc/passwd", "UNSAFE_PATH"),
            (b"C:/x", "UNSAFE_PATH"),
            (b"a\\..\\b", "UNSAFE_PATH"),
            (b"a//b", "UNSAFE_PATH"),
            (b"a\0b", "BAD_NAME"),
            (b"fr\xe4mes/1.png", "BAD_NAME"),
            (&[b'a'; 500], "BAD_NAME"),
        ] {
            assert_eq!(checked(bad).expect_err("refused").code, code, "{bad:?}");
        }
    }
}
