//! `.ply` files of Gaussian splats, in the format of the original 3D Gaussian splatting (Kerbl et al., 2023), which
//! every viewer of splats reads.

use super::{Gaussian, HARMONICS};
use std::io::{self, Write};

/// Harmonics of the degrees 1 to 3. Some readers refuse files without them.
const REST: usize = 15;
/// Signs of the harmonics of degree 1 and 2 after half a turn about x.
const SIGNS: [f32; HARMONICS] = [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0];
/// Least distance of an opacity from 0 and 1, where the logit is infinite.
const CLEAR: f32 = 1e-6;

/// Writes `splats`. The file has x to the right, y down and z forward, as viewers expect.
///
/// # Errors
/// If writing fails.
pub fn write(to: &mut impl Write, splats: &[Gaussian]) -> io::Result<()> {
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        splats.len()
    )?;
    let fields = [
        "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2",
    ];
    let mut fields: Vec<String> = fields.map(str::to_owned).to_vec();
    fields.extend((0..3 * REST).map(|i| format!("f_rest_{i}")));
    fields.push("opacity".into());
    fields.extend((0..3).map(|i| format!("scale_{i}")));
    fields.extend((0..4).map(|i| format!("rot_{i}")));
    for field in &fields {
        writeln!(to, "property float {field}")?;
    }
    writeln!(to, "end_header")?;
    let mut row = Vec::with_capacity(fields.len());
    for splat in splats {
        let [x, y, z] = splat.mean;
        let [a, b, c, d] = splat.rotation;
        let opacity = splat.opacity.clamp(CLEAR, 1.0 - CLEAR);
        row.clear();
        row.extend([x, -y, -z]);
        row.extend([0.0; 3]);
        row.extend(splat.harmonic());
        // All coefficients of one channel, then of the next.
        for channel in 0..3 {
            let own = splat.harmonics.iter().zip(SIGNS);
            row.extend(own.map(|(harmonic, sign)| sign * harmonic[channel]));
            row.extend([0.0; REST - HARMONICS]);
        }
        row.push((opacity / (1.0 - opacity)).ln());
        row.extend(splat.deviations.map(f32::ln));
        // After a half turn about x.
        row.extend([-b, a, -d, c]);
        for value in &row {
            to.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::HARMONIC;

    #[test]
    fn rows_have_every_field_in_its_place() {
        let splat = Gaussian {
            mean: [1.0, 2.0, 3.0],
            rotation: [0.5, 0.5, -0.5, 0.5],
            deviations: [0.01, 0.02, 0.03],
            opacity: 0.9,
            colour: [0.5, 0.25, 1.0],
            harmonics: std::array::from_fn(|k| [0.0, 1.0 + k as f32, -1.0]),
        };
        let mut bytes = Vec::new();
        write(&mut bytes, &[splat, splat]).expect("writes");
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|part| part == end);
        let start = start.expect("a header") + end.len();
        let header = String::from_utf8_lossy(&bytes[..start]).into_owned();
        let fields: Vec<&str> = header
            .lines()
            .filter_map(|line| line.strip_prefix("property float "))
            .collect();
        assert_eq!(bytes.len() - start, 2 * 248);
        assert_eq!(4 * fields.len(), 248);
        let value = |name: &str| {
            let index = fields.iter().position(|field| *field == name);
            let at = start + 248 + 4 * index.expect("a field");
            f32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"))
        };
        assert_eq!(["x", "y", "z"].map(value), [1.0, -2.0, -3.0]);
        assert!((0.5 + HARMONIC * value("f_dc_1") - 0.25).abs() < 1e-6);
        assert!((value("opacity") - 9f32.ln()).abs() < 1e-4);
        assert!((value("scale_2") - 0.03f32.ln()).abs() < 1e-6);
        assert_eq!(
            ["rot_0", "rot_1", "rot_2", "rot_3"].map(value),
            [-0.5, 0.5, -0.5, -0.5]
        );
        // Green. The harmonics of y and z in degree 1 and of xy and xz in degree 2 change sign.
        let green: [f32; 8] = std::array::from_fn(|k| value(&format!("f_rest_{}", 15 + k)));
        assert_eq!(green, [-1.0, -2.0, 3.0, -4.0, 5.0, 6.0, -7.0, 8.0]);
        assert_eq!(
            ["f_rest_2", "f_rest_32", "f_rest_44"].map(value),
            [0.0, -1.0, 0.0]
        );
    }

    #[test]
    fn opaque_and_clear_splats_are_finite() {
        for opacity in [0.0, 1.0] {
            let splat = Gaussian {
                mean: [0.0; 3],
                rotation: [1.0, 0.0, 0.0, 0.0],
                deviations: [0.01; 3],
                opacity,
                colour: [0.0; 3],
                harmonics: [[0.0; 3]; HARMONICS],
            };
            let mut bytes = Vec::new();
            write(&mut bytes, &[splat]).expect("writes");
            let row = bytes.len() - 248;
            assert!(
                bytes[row..]
                    .as_chunks::<4>()
                    .0
                    .iter()
                    .all(|value| f32::from_le_bytes(*value).is_finite())
            );
        }
    }
}
