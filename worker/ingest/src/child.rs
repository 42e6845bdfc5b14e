//! The child's side: set the limits, carry out the order, report the outcome.

use super::backdrop;
use super::confinement::{Room, confine};
use super::failure::ReadFailure;
use super::film::{self, FilmReader};
use super::order::{Order, Outcome, ReplyLine, Task};
use super::prepare::prepare;
use nix::sys::resource::{Resource, setrlimit};
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use yoto_media::MEMORY_LIMIT;
use yoto_media::video::Ffmpeg;

/// The argument that makes this program the child. The order's file and the limits of memory, bytes, and time, seconds,
/// follow it.
pub(super) const ARGUMENT: &str = "read-one-upload";
/// Most files that the child has open at once: an archive, a picture, a mask, a shard, and pipes.
const OPEN_FILES: u64 = 256;

/// If this process has the arguments of a child, reads one upload and ends the process. Otherwise does nothing.
///
/// A program that runs a worker calls this first, before it starts threads or reads arguments:
/// the worker starts the program again with these arguments. `films` reads films without poses, where the program can.
pub fn become_ingest_child_if_asked(films: Option<FilmReader>) {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let [argument, order, memory, seconds] = arguments.as_slice() else {
        return;
    };
    if argument != ARGUMENT {
        return;
    }
    let number = |text: &OsString| text.to_str().and_then(|text| text.parse().ok());
    let outcome = match (number(memory), number(seconds)) {
        (Some(memory), Some(seconds)) => run(Path::new(order), memory, seconds, films),
        _ => Outcome::Machine("the child was started with invalid limits".into()),
    };
    say(&ReplyLine::End(outcome));
    std::process::exit(0);
}

fn run(order: &Path, memory: u64, seconds: u64, films: Option<FilmReader>) -> Outcome {
    let mut order = match std::fs::read(order).map(|bytes| serde_json::from_slice::<Order>(&bytes))
    {
        Ok(Ok(order)) => order,
        Ok(Err(error)) => return Outcome::Machine(format!("the child's order: {error}")),
        Err(error) => return Outcome::Machine(format!("the child's order: {error}")),
    };
    if let Err(error) = limit(memory, seconds, order.limits.unpacked_bytes) {
        return Outcome::Machine(format!("limiting the child: {error}"));
    }
    let ffmpeg = match order.task {
        Task::Capture => Ffmpeg::find(order.ffmpeg.as_deref()),
        Task::Backdrop => Ffmpeg::none(),
    };
    let room = Room {
        folder: order.folder.clone(),
        read: order
            .files
            .values()
            .chain(&order.pose_model)
            .cloned()
            .collect(),
        program: ffmpeg.program().map(Path::to_owned),
    };
    if let Err(error) = confine(&room) {
        return Outcome::Machine(format!("confining the child: {error}"));
    }
    let tell = |progress| say(&ReplyLine::At(progress));
    let prepared = match order.task {
        Task::Capture => film::found(&mut order, films, tell).and_then(|film| {
            let mut prepared = prepare(&order, &ffmpeg, &mut { tell })?;
            if let Some(film) = film {
                prepared.notes.splice(0..0, film.notes);
                prepared.warnings.splice(0..0, film.warnings);
            }
            Ok(prepared)
        }),
        Task::Backdrop => backdrop::prepare(&order, &mut { tell }),
    };
    match prepared {
        Ok(prepared) => Outcome::Done(prepared),
        Err(ReadFailure::Rejected(mut found)) => {
            // Only this function knows the limit.
            for fault in found.iter_mut().filter(|it| it.code == MEMORY_LIMIT) {
                fault.message += &format!(": the limit is {} MiB", memory >> 20);
            }
            Outcome::Rejected(found.into_iter().map(Into::into).collect())
        }
        Err(ReadFailure::Machine(message)) => Outcome::Machine(message),
    }
}

/// Limits enforced by the kernel, independent of decoders. They also apply to an `ffmpeg` started
/// by this process.
fn limit(memory: u64, seconds: u64, file_bytes: u64) -> nix::Result<()> {
    // Dies with the worker, even if the worker is killed.
    #[cfg(target_os = "linux")]
    nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGKILL)?;
    // If the machine runs out of memory, the kernel kills this process before the worker and other
    // programs. Without the permission for this, the kernel chooses as usual.
    #[cfg(target_os = "linux")]
    let _ = std::fs::write("/proc/self/oom_score_adj", "1000");
    setrlimit(Resource::RLIMIT_CORE, 0, 0)?;
    setrlimit(Resource::RLIMIT_NOFILE, OPEN_FILES, OPEN_FILES)?;
    setrlimit(Resource::RLIMIT_FSIZE, file_bytes, file_bytes)?;
    setrlimit(Resource::RLIMIT_CPU, seconds, seconds + 5)?;
    setrlimit(Resource::RLIMIT_AS, memory, memory)
}

fn say(line: &ReplyLine) {
    let Ok(mut text) = serde_json::to_string(line) else {
        return;
    };
    text.push('\n');
    // A write fails only after the worker's end, which ends this process as well.
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}
