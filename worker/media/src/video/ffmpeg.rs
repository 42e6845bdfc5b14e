//! Decodes other videos with an `ffmpeg` program, if one is installed.
//!
//! It reads only this file, in the listed formats, so that a playlist inside an upload can't
//! make it read other files, and with the listed decoders, since those that no camera needs are attacked as well. It
//! inherits the limits of this process.

use super::hdr::Hdr;
use super::light::Levels;
use super::signal::Signal;
use super::{Raw, ppm};
use crate::{Limits, MEMORY_LIMIT, MediaError, MediaFault};
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};

/// The variable by which a command line names the program, for errors.
pub const VARIABLE: &str = "YOTO_FFMPEG";
/// Containers that may be opened.
const FORMATS: &str =
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,h264,hevc,ogg,flv,asf,mxf";
/// Decoders that may be used, by the program's names. Sound is never decoded.
const DECODERS: &str = "h264,hevc,vp8,vp9,libvpx,libvpx-vp9,av1,libdav1d,libaom-av1,mpeg1video,mpeg2video,mpeg4,\
     msmpeg4v3,h263,flv,wmv3,vc1,theora,mjpeg,prores,dnxhd,ffv1,rawvideo";
/// Bytes kept of its standard error.
const COMPLAINTS: u64 = 16 << 10;

/// The program, if there is one.
#[derive(Debug, Clone, Default)]
pub struct Ffmpeg {
    program: Option<PathBuf>,
}

impl Ffmpeg {
    /// The program `named`, else `ffmpeg` in the search path.
    pub fn find(named: Option<&Path>) -> Self {
        let program = match named {
            Some(path) => path.is_file().then(|| path.to_owned()),
            None => std::env::var_os("PATH").and_then(|path| {
                std::env::split_paths(&path)
                    .map(|folder| folder.join("ffmpeg"))
                    .find(|program| program.is_file())
            }),
        };
        Self { program }
    }

    /// Path of the program.
    pub fn program(&self) -> Option<&Path> {
        self.program.as_deref()
    }

    /// No program at all.
    pub fn none() -> Self {
        Self { program: None }
    }

    /// Starts decoding `path`. `what` describes it, for the error without a program; `most` is the number of its frames, if
    /// the program would find more, damaged ones.
    pub(super) fn open(
        &self,
        path: &Path,
        what: &str,
        limits: &Limits,
        need_times: bool,
        most: Option<usize>,
        hdr: Hdr,
    ) -> Result<FfmpegVideo, MediaError> {
        let Some(program) = &self.program else {
            let message = format!(
                "{what} is not decoded in-process, only 8-bit 4:2:0 H.264 in MP4 or MOV is; the \
                 worker would hand it to ffmpeg, but none is installed there (not in PATH, not \
                 named by {VARIABLE})"
            );
            return Err(MediaFault::new("NEEDS_FFMPEG", message).into());
        };
        let mut about = probe(program, path, limits, need_times)?;
        about.times.truncate(most.unwrap_or(usize::MAX));
        // Eight bits are too few for light of a hundred times the range.
        let is_deep = hdr.of(about.signal).light().is_some();
        // Otherwise levels of 8 bits are cut off rather than rounded.
        let levels = if is_deep { "rgb48be" } else { "rgb24" };
        let levels = format!("scale=flags=bicubic+accurate_rnd,format={levels}");
        let mut child = command(program, path, "error")
            .args(["-vf", &levels, "-fps_mode", "passthrough"])
            .args(["-c:v", "ppm", "-f", "image2pipe", "pipe:1"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(MediaError::io(program))?;
        let stdout = child.stdout.take().map(BufReader::new);
        let complaints = child.stderr.take().map(|stderr| {
            std::thread::spawn(move || {
                let (mut text, mut stderr) = (Vec::new(), BufReader::new(stderr));
                // The pipe is read to its end even past the kept part: a program that can't write its
                // complaints would block. A failure to read them is not reported.
                let _ = (&mut stderr).take(COMPLAINTS).read_to_end(&mut text);
                let _ = std::io::copy(&mut stderr, &mut std::io::sink());
                String::from_utf8_lossy(&text).into_owned()
            })
        });
        Ok(FfmpegVideo {
            child,
            stdout,
            complaints,
            limits: limits.clone(),
            what: what.to_owned(),
            about,
            most,
            out: 0,
        })
    }
}

fn command(program: &Path, path: &Path, level: &str) -> Command {
    // The prefix keeps a path with a colon from being read as a protocol.
    let mut input = std::ffi::OsString::from("file:");
    input.push(path);
    let mut command = Command::new(program);
    command
        .args(["-nostdin", "-hide_banner", "-nostats", "-loglevel", level])
        .args(["-threads", "1", "-protocol_whitelist", "file,pipe"])
        .args(["-format_whitelist", FORMATS])
        .args(["-codec_whitelist", DECODERS, "-i"])
        .arg(input)
        .args(["-map", "0:v:0", "-an", "-sn", "-dn"])
        .stdin(Stdio::null());
    command
}

/// What the program says about a video.
#[derive(Debug)]
pub(super) struct About {
    /// Time of each frame, ascending, seconds from the first.
    pub(super) times: Vec<f64>,
    pub(super) signal: Signal,
    /// Width and height of a pixel as shown, if the file declares them.
    pub(super) aspect: Option<[u32; 2]>,
}

/// Runs the program to list frames: all of them, or only the first.
fn probe(program: &Path, path: &Path, limits: &Limits, all: bool) -> Result<About, MediaError> {
    let mut command = command(program, path, "info");
    command.args(["-vf", "showinfo", "-fps_mode", "passthrough"]);
    if !all {
        command.args(["-frames:v", "1"]);
    }
    let mut child = command
        .args(["-f", "null", "-"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(MediaError::io(program))?;
    let (mut times, mut signal, mut aspect) = (Vec::<f64>::new(), None, None);
    if let Some(stderr) = child.stderr.take() {
        for line in BufReader::new(stderr).lines().map_while(Result::ok) {
            let value = |name: &str| line.split_once(name)?.1.split_whitespace().next();
            if let Some(time) = value("pts_time:").and_then(|text| text.parse().ok()) {
                times.push(time);
                let sides = value(" sar:").and_then(|text| text.split_once('/'));
                let sides = sides.and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
                aspect = aspect.or(sides);
            }
            signal = signal.or_else(|| Signal::from_showinfo(&line));
            if times.len() > limits.frames {
                break;
            }
        }
    }
    // It may have ended already.
    let _ = child.kill();
    child.wait().map_err(MediaError::io(program))?;
    if times.len() > limits.frames {
        return Err(too_many(limits).into());
    }
    if !all {
        times.clear();
    }
    times.sort_by(f64::total_cmp);
    let first = times.first().copied().unwrap_or(0.0);
    Ok(About {
        times: times.into_iter().map(|time| time - first).collect(),
        signal: signal.unwrap_or(Signal::UNSPECIFIED),
        aspect,
    })
}

fn too_many(limits: &Limits) -> MediaFault {
    let message = format!("the video has more than {} frames", limits.frames);
    MediaFault::new("TOO_LARGE", message)
}

/// A video, decoded by the program frame by frame.
#[derive(Debug)]
pub(super) struct FfmpegVideo {
    child: Child,
    stdout: Option<BufReader<ChildStdout>>,
    complaints: Option<std::thread::JoinHandle<String>>,
    limits: Limits,
    pub(super) what: String,
    pub(super) about: About,
    most: Option<usize>,
    out: usize,
}

impl FfmpegVideo {
    /// The next frame shown; `None` after the last, or for a skipped frame.
    pub(super) fn next(&mut self, skip: bool) -> Result<Option<Raw>, MediaError> {
        if self.most.is_some_and(|most| self.out >= most) {
            return Ok(None);
        }
        let Some(stdout) = &mut self.stdout else {
            return Ok(None);
        };
        let header = match ppm::header(stdout) {
            Ok(Some(header)) => header,
            Ok(None) => return self.end(),
            Err(_) => return self.broken(),
        };
        let [width, height, highest] = header;
        let side = self.limits.side as usize;
        if width == 0 || height == 0 || width > side || height > side {
            let message = format!("{width}x{height} pixels; each side must be 1 to {side}");
            return Err(MediaFault::new("TOO_LARGE", message).into());
        }
        if self.out >= self.limits.frames {
            return Err(too_many(&self.limits).into());
        }
        let is_deep = highest > 255;
        let mut rgb = vec![0; width * height * 3 * (1 + usize::from(is_deep))];
        if stdout.read_exact(&mut rgb).is_err() {
            return self.broken();
        }
        self.out += 1;
        Ok((!skip).then(|| Raw {
            width,
            height,
            levels: match is_deep {
                false => Levels::Eight(rgb),
                true => {
                    let words = rgb.as_chunks().0.iter();
                    Levels::Sixteen(words.map(|word| u16::from_be_bytes(*word)).collect())
                }
            },
        }))
    }

    /// The stream ended between two frames: at its end, or because the program failed.
    fn end(&mut self) -> Result<Option<Raw>, MediaError> {
        let status = self.wait()?;
        if status.success() && self.out > 0 {
            return Ok(None);
        }
        Err(self.failure(status))
    }

    /// The stream ended inside a frame, or is not a stream of frames.
    fn broken(&mut self) -> Result<Option<Raw>, MediaError> {
        let status = self.wait()?;
        Err(self.failure(status))
    }

    /// Waits for its end. A program that is still writing ends now, since its output is closed.
    fn wait(&mut self) -> Result<ExitStatus, MediaError> {
        self.stdout = None;
        self.child
            .wait()
            .map_err(MediaError::io(Path::new("ffmpeg")))
    }

    fn failure(&mut self, status: ExitStatus) -> MediaError {
        let said = self.complaints.take().and_then(|it| it.join().ok());
        failure(status, &said.unwrap_or_default(), self.out)
    }
}

/// The reason why the program ended, after `frames` frames.
fn failure(status: ExitStatus, said: &str, frames: usize) -> MediaError {
    /// Interrupt, quit, kill, terminate and hang-up: signals that come from outside.
    const OUTSIDE: [i32; 5] = [2, 3, 9, 15, 1];
    /// The limit of this process's processor time.
    const OVERTIME: i32 = 24;
    let signal = status.signal().unwrap_or_default();
    if OUTSIDE.contains(&signal) {
        return MediaError::Io {
            path: "ffmpeg".into(),
            source: std::io::Error::other(format!("was killed from outside by signal {signal}")),
        };
    }
    let fault = if signal == OVERTIME {
        MediaFault::new("TIME_LIMIT", "ffmpeg took all the processor time allowed")
    } else if said.contains("Cannot allocate memory") {
        MediaFault::new(MEMORY_LIMIT, "ffmpeg had not enough memory to decode it")
    } else {
        let mut last = said.lines().rev().filter(|line| !line.trim().is_empty());
        let why = last.next().unwrap_or("no frame came out");
        match last.next().and_then(refused_codec) {
            Some(codec) if why.contains("opening decoder") => MediaFault::undecodable(format!(
                "its codec is {codec}; those that are read with ffmpeg are {DECODERS}"
            )),
            _ => MediaFault::undecodable(format!("ffmpeg: {why}")),
        }
    };
    fault.in_frame(frames).into()
}

/// The codec that a line of the program names as absent from [`DECODERS`].
fn refused_codec(line: &str) -> Option<&str> {
    let (before, _) = line.split_once(") not on whitelist")?;
    Some(before.rsplit_once('(')?.1)
}

impl Drop for FfmpegVideo {
    fn drop(&mut self) {
        // It may have ended already; then there is nothing to do.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ended_the_program_says_whose_fault_it_was() {
        let end = |raw: i32, said: &str| failure(ExitStatus::from_raw(raw), said, 3);
        for signal in [1, 2, 3, 9, 15] {
            assert!(matches!(end(signal, ""), MediaError::Io { .. }), "{signal}");
        }
        let code = |error: MediaError| match error {
            MediaError::Bad(fault) => (fault.code, fault.frame, fault.message),
            MediaError::Io { .. } => panic!("not the machine's fault"),
        };
        assert_eq!(code(end(24, "")).0, "TIME_LIMIT");
        assert_eq!(
            code(end(1 << 8, "x: Cannot allocate memory")).0,
            MEMORY_LIMIT
        );
        let (kind, frame, message) = code(end(1 << 8, "one\nmoov atom not found\n"));
        assert_eq!((kind, frame), ("UNDECODABLE", Some(3)));
        assert!(message.ends_with("moov atom not found"), "{message}");
    }

    #[test]
    fn without_the_program_the_error_says_what_would_help() {
        let error = Ffmpeg::none()
            .open(
                Path::new("x.avi"),
                "AVI",
                &Limits::default(),
                false,
                None,
                Hdr::Auto,
            )
            .expect_err("none is there");
        let text = error.to_string();
        assert!(
            text.contains("AVI") && text.contains("ffmpeg") && text.contains(VARIABLE),
            "{text}"
        );
    }
}
