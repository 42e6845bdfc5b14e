//! Options for the conventions of a capture's numbers.

use clap::{Args, ValueEnum};
use std::str::FromStr;
use yoto_proto::correction::{CameraAxes, Correction, Extrinsics, Mirror, Unit, Units};

/// Conventions of the capture's numbers; `yoto capture check` finds the options that are needed.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Reading the capture's numbers")]
pub(crate) struct CorrectionArgs {
    /// Direction of the extrinsics: world to camera, or camera to world.
    #[arg(long, value_enum, default_value = "w2c")]
    extrinsics: ExtrinsicsArg,
    /// Axes of the cameras: x right, y down, z forward (opencv); x right, y up, z back (opengl).
    #[arg(long, value_enum, default_value = "opencv")]
    camera_axes: CameraAxesArg,
    /// Unit of lengths: m, cm or mm; or separately for camera, root and skeleton: camera=mm,root=cm.
    #[arg(long, value_name = "UNIT", default_value = "m", value_parser = units)]
    units: Units,
    /// Turn all bodies about the world's x axis, degrees (-90: z-up poses, y-up cameras).
    #[arg(long, value_name = "DEG", default_value = "0", allow_negative_numbers = true, value_parser = degrees)]
    turn_bodies: f64,
    /// Exchange left and right in the poses, in their limbs only, in the labels, or in the images.
    #[arg(long, value_enum, value_name = "WHAT", num_args = 0..=1, default_value = "none", default_missing_value = "poses")]
    mirror: MirrorArg,
    /// Factor for K, where the intrinsics belong to another image size.
    #[arg(long, value_name = "S", default_value = "1", value_parser = scale)]
    k_scale: f64,
    /// For each frame, use the mask of N frames later (earlier if negative).
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    mask_shift: i32,
    /// For each frame, use the pose of N frames later (earlier if negative).
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    pose_shift: i32,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ExtrinsicsArg {
    W2c,
    C2w,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum CameraAxesArg {
    Opencv,
    Opengl,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MirrorArg {
    None,
    Poses,
    Limbs,
    Labels,
    Images,
}

impl CorrectionArgs {
    /// The correction that the options describe.
    pub(crate) fn correction(&self) -> Correction {
        Correction {
            extrinsics: match self.extrinsics {
                ExtrinsicsArg::W2c => Extrinsics::WorldToCamera,
                ExtrinsicsArg::C2w => Extrinsics::CameraToWorld,
            },
            camera_axes: match self.camera_axes {
                CameraAxesArg::Opencv => CameraAxes::OpenCv,
                CameraAxesArg::Opengl => CameraAxes::OpenGl,
            },
            units: self.units,
            turn_bodies: self.turn_bodies,
            mirror: match self.mirror {
                MirrorArg::None => Mirror::None,
                MirrorArg::Poses => Mirror::Poses,
                MirrorArg::Limbs => Mirror::Limbs,
                MirrorArg::Labels => Mirror::Labels,
                MirrorArg::Images => Mirror::Images,
            },
            k_scale: self.k_scale,
            mask_shift: self.mask_shift,
            pose_shift: self.pose_shift,
        }
    }
}

fn units(text: &str) -> Result<Units, String> {
    let unit = |symbol: &str| match symbol {
        "m" => Ok(Unit::Metre),
        "cm" => Ok(Unit::Centimetre),
        "mm" => Ok(Unit::Millimetre),
        other => Err(format!("'{other}' is not a unit: m, cm or mm")),
    };
    if !text.contains('=') {
        return Ok(Units::all(unit(text)?));
    }
    let mut units = Units::default();
    for part in text.split(',') {
        let (name, symbol) = part
            .split_once('=')
            .ok_or_else(|| format!("'{part}' is not like camera=mm"))?;
        let field = match name {
            "camera" => &mut units.camera,
            "root" => &mut units.root,
            "skeleton" => &mut units.skeleton,
            other => return Err(format!("'{other}' is not one of camera, root, skeleton")),
        };
        *field = unit(symbol)?;
    }
    Ok(units)
}

fn degrees(text: &str) -> Result<f64, String> {
    number(text, |value| value.abs() <= 360.0, "between -360 and 360")
}

fn scale(text: &str) -> Result<f64, String> {
    number(
        text,
        |value| (1e-3..=1e3).contains(&value),
        "between 0.001 and 1000",
    )
}

fn number(text: &str, fits: impl Fn(f64) -> bool, range: &str) -> Result<f64, String> {
    let value = f64::from_str(text).map_err(|error| error.to_string())?;
    if fits(value) {
        Ok(value)
    } else {
        Err(format!("{value} is not {range}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: CorrectionArgs,
    }

    fn parse(line: &str) -> Result<Correction, clap::Error> {
        let words = std::iter::once("x").chain(line.split_whitespace());
        Line::try_parse_from(words).map(|line| line.args.correction())
    }

    #[test]
    fn what_a_check_prints_is_what_the_command_line_reads() {
        assert!(parse("").expect("nothing asked").is_identity());
        for line in [
            "--extrinsics c2w --camera-axes opengl",
            "--units mm",
            "--units camera=mm,root=cm --turn-bodies -90",
            "--mirror images --k-scale 0.5",
            "--mirror limbs --mask-shift -1",
            "--mirror labels --pose-shift 3",
            "--mirror poses --k-scale 1.3333",
        ] {
            assert_eq!(parse(line).expect("parses").to_string(), line);
        }
        assert_eq!(parse("--mirror").expect("parses").mirror, Mirror::Poses);
    }

    #[test]
    fn nonsense_is_refused() {
        for line in [
            "--units inch",
            "--units camera=mm,head=m",
            "--k-scale 0",
            "--k-scale nan",
            "--turn-bodies 1e9",
            "--mask-shift 0.5",
            "--extrinsics both",
        ] {
            assert!(parse(line).is_err(), "{line}");
        }
    }
}
