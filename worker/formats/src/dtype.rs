//! Element types of numpy, by their codes such as `<f4`.

use crate::Value;

/// Element type of an array.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Dtype {
    /// Letter and size, without the byte order: `f4`, `U12`.
    code: String,
    big_endian: bool,
}

impl Dtype {
    /// Parses a code with or without a byte order in front.
    pub(crate) fn new(code: &str) -> Self {
        Self {
            big_endian: code.starts_with('>'),
            code: code.trim_start_matches(['<', '>', '=', '|']).to_owned(),
        }
    }

    /// This type with another byte order.
    pub(crate) fn with_order(&self, big_endian: bool) -> Self {
        Self {
            big_endian,
            ..self.clone()
        }
    }

    /// Whether elements are Python objects, which are stored as a pickle.
    pub(crate) fn is_object(&self) -> bool {
        self.code.starts_with('O')
    }

    /// Whether elements are strings.
    pub(crate) fn is_text(&self) -> bool {
        self.code.starts_with(['U', 'S', 'a'])
    }

    /// Bytes of an element; `None` for an unknown type.
    pub(crate) fn size(&self) -> Option<usize> {
        Some(match self.code.as_str() {
            "b1" | "i1" | "u1" | "?" | "b" | "B" => 1,
            "f2" | "i2" | "u2" | "bf2" => 2,
            "f4" | "i4" | "u4" => 4,
            "f8" | "i8" | "u8" => 8,
            text => match text.split_at_checked(1)? {
                ("U", length) => 4 * length.parse::<usize>().ok().filter(|l| *l < 1 << 20)?,
                ("S" | "a", length) => length.parse::<usize>().ok().filter(|l| *l < 1 << 20)?,
                _ => return None,
            },
        })
    }

    /// The numbers in `bytes`; `None` if elements are not numbers.
    pub(crate) fn numbers(&self, bytes: &[u8]) -> Option<Vec<f64>> {
        let each = |size: usize, convert: &dyn Fn(u64) -> f64| -> Vec<f64> {
            bytes
                .chunks_exact(size)
                .map(|chunk| {
                    let join = |bits: u64, byte: &u8| bits << 8 | u64::from(*byte);
                    convert(if self.big_endian {
                        chunk.iter().fold(0, join)
                    } else {
                        chunk.iter().rev().fold(0, join)
                    })
                })
                .collect()
        };
        Some(match self.code.as_str() {
            "f8" => each(8, &f64::from_bits),
            "f4" => each(4, &|bits| f64::from(f32::from_bits(bits as u32))),
            "f2" => each(2, &|bits| half(bits as u16)),
            // The upper half of a float: torch's bfloat16, which numpy lacks.
            "bf2" => each(2, &|bits| f64::from(f32::from_bits((bits as u32) << 16))),
            "i8" => each(8, &|bits| bits as i64 as f64),
            "i4" => each(4, &|bits| f64::from(bits as u32 as i32)),
            "i2" => each(2, &|bits| f64::from(bits as u16 as i16)),
            "i1" | "b" => each(1, &|bits| f64::from(bits as u8 as i8)),
            "u8" => each(8, &|bits| bits as f64),
            "u4" | "u2" | "u1" | "b1" | "?" | "B" => each(self.size()?, &|bits| bits as f64),
            _ => return None,
        })
    }

    /// The strings in `bytes`, without padding zeros; `None` for other types.
    pub(crate) fn texts(&self, bytes: &[u8]) -> Option<Vec<Value>> {
        let size = self.size().filter(|size| *size > 0)?;
        let wide = match self.code.as_bytes().first()? {
            b'U' => true,
            b'S' | b'a' => false,
            _ => return None,
        };
        let text = |element: &[u8]| -> String {
            if !wide {
                return String::from_utf8_lossy(element).into_owned();
            }
            let letter = |bytes: &[u8; 4]| {
                let code = if self.big_endian {
                    u32::from_be_bytes(*bytes)
                } else {
                    u32::from_le_bytes(*bytes)
                };
                char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)
            };
            element.as_chunks::<4>().0.iter().map(letter).collect()
        };
        let texts = bytes.chunks_exact(size).map(|element| {
            let text = text(element);
            Value::Text(text.trim_end_matches('\0').to_owned())
        });
        Some(texts.collect())
    }
}

/// The value of an IEEE half.
fn half(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_in_every_type_and_order() {
        let read = |code: &str, bytes: &[u8]| Dtype::new(code).numbers(bytes);
        assert_eq!(read("<f4", &1.5f32.to_le_bytes()), Some(vec![1.5]));
        assert_eq!(read(">f8", &(-2.5f64).to_be_bytes()), Some(vec![-2.5]));
        assert_eq!(read("<i2", &(-7i16).to_le_bytes()), Some(vec![-7.0]));
        assert_eq!(read("|u1", &[200, 3]), Some(vec![200.0, 3.0]));
        assert_eq!(read("|b1", &[1, 0]), Some(vec![1.0, 0.0]));
        // numpy.float16([1, -2, 65504, 2**-24, inf])
        let halves = [0x3c00u16, 0xc000, 0x7bff, 0x0001, 0x7c00];
        let bytes: Vec<u8> = halves.iter().flat_map(|h| h.to_le_bytes()).collect();
        let expected = vec![1.0, -2.0, 65504.0, 2f64.powi(-24), f64::INFINITY];
        assert_eq!(read("<f2", &bytes), Some(expected));
        assert_eq!(read("<c8", &[0; 8]), None);
    }

    #[test]
    fn texts_lose_their_padding() {
        let wide: Vec<u8> = "ab\0"
            .chars()
            .flat_map(|c| (c as u32).to_le_bytes())
            .collect();
        assert_eq!(
            Dtype::new("<U3").texts(&wide),
            Some(vec![Value::Text("ab".into())])
        );
        assert_eq!(
            Dtype::new("|S2").texts(b"xyz\0"),
            Some(vec![Value::Text("xy".into()), Value::Text("z".into())])
        );
    }
}
