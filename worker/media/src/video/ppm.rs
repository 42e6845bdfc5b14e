//! Headers of PPM pictures, the form in which `ffmpeg` writes decoded frames into a pipe.

use std::io::BufRead;

/// Width, height and highest level, 255 or 65535, after `P6` and before one blank; `None` at the end of the stream.
pub(super) fn header(stream: &mut impl BufRead) -> std::io::Result<Option<[usize; 3]>> {
    let odd = || std::io::Error::new(std::io::ErrorKind::InvalidData, "not a PPM header");
    if stream.fill_buf()?.is_empty() {
        return Ok(None);
    }
    let mut words = Vec::new();
    let mut word = String::new();
    while words.len() < 4 {
        let mut byte = [0];
        stream.read_exact(&mut byte)?;
        match byte[0] {
            b' ' | b'\n' if word.is_empty() => return Err(odd()),
            b' ' | b'\n' => words.push(std::mem::take(&mut word)),
            digit if word.len() < 8 => word.push(char::from(digit)),
            _ => return Err(odd()),
        }
    }
    match words.as_slice() {
        [magic, width, height, depth] if magic == "P6" => {
            let number = |text: &str| text.parse().map_err(|_| odd());
            let highest = number(depth)?;
            if highest != 255 && highest != 65535 {
                return Err(odd());
            }
            Ok(Some([number(width)?, number(height)?, highest]))
        }
        _ => Err(odd()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_and_others_refused() {
        let read = |bytes: &[u8]| header(&mut &bytes[..]);
        assert_eq!(
            read(b"P6\n50 38\n255\nRGB").expect("fine"),
            Some([50, 38, 255])
        );
        let deep = read(b"P6\n50 38\n65535\nRRGGBB").expect("fine");
        assert_eq!(deep, Some([50, 38, 65535]));
        assert_eq!(read(b"").expect("the end"), None);
        for bad in [
            &b"P5\n1 1\n255\n"[..],
            b"P6\n1 1\n1023\n",
            b"P6\n1",
            b"P6 123456789 1 255 ",
        ] {
            assert!(read(bad).is_err(), "{bad:?}");
        }
    }
}
