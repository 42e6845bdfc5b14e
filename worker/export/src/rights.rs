//! What the person of a file agrees to, in the field that the format has for it.

use serde_json::{Value, json};
use yoto_player::escaped;

/// Bytes of the header of a `.glb`, and of that of a chunk.
const HEADER: usize = 12;
const CHUNK: usize = 8;

/// A file with the extension, whose `bytes` this program has written, with the line `rights`; as it is where the line is empty or
/// the format has no place for it (`.spz`, `.png`).
///
/// - `.glb`: `asset.copyright`
/// - `.html`: `<meta name="dcterms.rights">`
/// - `.ply`: a comment of the header
/// - `.obj`, `.mtl`: a comment in the first line
pub(crate) fn with_rights(extension: &str, bytes: Vec<u8>, rights: &str) -> Vec<u8> {
    if rights.is_empty() {
        return bytes;
    }
    let said = match extension {
        "glb" => of_glb(&bytes, rights),
        "html" => {
            let meta = format!(
                "\n<meta name=\"dcterms.rights\" content=\"{}\">",
                escaped(rights)
            );
            after(&bytes, b"<meta charset=\"utf-8\">", &meta)
        }
        "ply" => after(
            &bytes,
            b"format binary_little_endian 1.0\n",
            &format!("comment {rights}\n"),
        ),
        "obj" | "mtl" => Some([format!("# {rights}\n").as_bytes(), &bytes].concat()),
        _ => None,
    };
    said.unwrap_or(bytes)
}

/// `bytes` with `text` behind the first `place`.
fn after(bytes: &[u8], place: &[u8], text: &str) -> Option<Vec<u8>> {
    let begin = bytes.windows(place.len()).position(|it| it == place)?;
    let (before, rest) = bytes.split_at(begin + place.len());
    Some([before, text.as_bytes(), rest].concat())
}

/// The chunk of JSON comes first in a `.glb`.
fn of_glb(bytes: &[u8], rights: &str) -> Option<Vec<u8>> {
    let length = bytes.get(HEADER..HEADER + 4)?.try_into().ok()?;
    let end = HEADER + CHUNK + u32::from_le_bytes(length) as usize;
    let mut scene: Value = serde_json::from_slice(bytes.get(HEADER + CHUNK..end)?).ok()?;
    scene["asset"]["copyright"] = json!(rights);
    let mut text = scene.to_string().into_bytes();
    // glTF demands a multiple of four.
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = bytes.get(end..)?;
    let whole = HEADER + CHUNK + text.len() + rest.len();
    let mut file = bytes.get(..8)?.to_vec();
    file.extend(u32::try_from(whole).ok()?.to_le_bytes());
    file.extend(u32::try_from(text.len()).ok()?.to_le_bytes());
    file.extend(b"JSON");
    file.extend(text);
    file.extend(rest);
    Some(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_formats::glb::{Numbers, Target};

    const RIGHTS: &str = "The person shown agrees to: export; not to: share";

    #[test]
    fn a_glb_says_it_as_its_copyright_and_keeps_its_numbers() {
        let mut numbers = Numbers::default();
        numbers.rows(&[[1u8, 2, 3, 4]], Target::Other);
        let mut file = Vec::new();
        numbers
            .write(json!({"scene": 0}), &mut file)
            .expect("writes");
        let said = with_rights("glb", file.clone(), RIGHTS);
        let length = u32::from_le_bytes(said[8..12].try_into().expect("four bytes"));
        assert_eq!(length as usize, said.len());
        let text = u32::from_le_bytes(said[12..16].try_into().expect("four bytes")) as usize;
        assert_eq!(text % 4, 0);
        let scene: Value = serde_json::from_slice(&said[20..20 + text]).expect("JSON");
        assert_eq!(scene["asset"]["copyright"], RIGHTS);
        assert_eq!(scene["asset"]["generator"], "yoto");
        assert!(said.ends_with(&file[file.len() - 12..]), "the numbers");
    }

    #[test]
    fn other_formats_say_it_where_readers_expect_words() {
        let said = |extension: &str, text: &str| {
            let bytes = with_rights(extension, text.as_bytes().to_vec(), RIGHTS);
            String::from_utf8(bytes).expect("text")
        };
        let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 0\nend_header\n";
        assert!(said("ply", ply).starts_with(&format!(
            "ply\nformat binary_little_endian 1.0\ncomment {RIGHTS}\nelement"
        )));
        assert_eq!(said("obj", "v 0 0 0\n"), format!("# {RIGHTS}\nv 0 0 0\n"));
        let page = said("html", "<head>\n<meta charset=\"utf-8\">\n</head>");
        assert!(page.contains(&format!("name=\"dcterms.rights\" content=\"{RIGHTS}\">")));
        assert_eq!(said("spz", "x"), "x");
        let silent = with_rights("obj", b"v 0 0 0\n".to_vec(), "");
        assert_eq!(silent, b"v 0 0 0\n");
    }
}
