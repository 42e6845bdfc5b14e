//! The child's side: take the limits on, do the order, say how it went.

use super::failure::ReadFailure;
use super::order::{Line, Order, Outcome};
use super::prepare::prepare;
use nix::sys::resource::{Resource, setrlimit};
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use yoto_media::MEMORY_LIMIT;
use yoto_media::video::Ffmpeg;

/// The argument that makes this program the child; followed by the order's file, the bytes of
/// memory and the seconds it may take.
pub(super) const ARGUMENT: &str = "read-one-upload";

/// Becomes the child that reads one upload, and ends the process with it, if the arguments of
/// this process ask for that. Does nothing otherwise.
///
/// A program that runs a worker calls this first, before it starts threads or reads arguments:
/// the worker starts the program again with these arguments.
pub fn become_ingest_child_if_asked() {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let [argument, order, memory, seconds] = arguments.as_slice() else {
        return;
    };
    if argument != ARGUMENT {
        return;
    }
    let number = |text: &OsString| text.to_str().and_then(|text| text.parse().ok());
    let outcome = match (number(memory), number(seconds)) {
        (Some(memory), Some(seconds)) => run(Path::new(order), memory, seconds),
        _ => Outcome::Machine("the child was started with limits that are no numbers".into()),
    };
    say(&Line::End(outcome));
    std::process::exit(0);
}

fn run(order: &Path, memory: u64, seconds: u64) -> Outcome {
    let order = match std::fs::read(order).map(|bytes| serde_json::from_slice::<Order>(&bytes)) {
        Ok(Ok(order)) => order,
        Ok(Err(error)) => return Outcome::Machine(format!("the child's order: {error}")),
        Err(error) => return Outcome::Machine(format!("the child's order: {error}")),
    };
    if let Err(error) = confine(memory, seconds, order.limits.unpacked_bytes) {
        return Outcome::Machine(format!("limiting the child: {error}"));
    }
    let ffmpeg = Ffmpeg::find(order.ffmpeg.as_deref());
    match prepare(&order, &ffmpeg, &mut |place| say(&Line::At(place))) {
        Ok(prepared) => Outcome::Done(prepared),
        Err(ReadFailure::Rejected(mut found)) => {
            // Only here is it known how much there was.
            for fault in found.iter_mut().filter(|it| it.code == MEMORY_LIMIT) {
                fault.message += &format!(": the limit is {} MiB", memory >> 20);
            }
            Outcome::Rejected(found.into_iter().map(Into::into).collect())
        }
        Err(ReadFailure::Machine(message)) => Outcome::Machine(message),
    }
}

/// Limits that the kernel keeps, whatever a decoder does. They hold for an `ffmpeg` that is
/// started from here as well.
fn confine(memory: u64, seconds: u64, file_bytes: u64) -> nix::Result<()> {
    // Dies with the worker, even if that is killed.
    #[cfg(target_os = "linux")]
    nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGKILL)?;
    // A machine that runs out of memory ends this process and not the worker or what else runs
    // there. Where that may not be said, the kernel chooses as ever.
    #[cfg(target_os = "linux")]
    let _ = std::fs::write("/proc/self/oom_score_adj", "1000");
    setrlimit(Resource::RLIMIT_CORE, 0, 0)?;
    setrlimit(Resource::RLIMIT_FSIZE, file_bytes, file_bytes)?;
    setrlimit(Resource::RLIMIT_CPU, seconds, seconds + 5)?;
    setrlimit(Resource::RLIMIT_AS, memory, memory)
}

fn say(line: &Line) {
    let Ok(mut text) = serde_json::to_string(line) else {
        return;
    };
    text.push('\n');
    // Nobody listens only if the worker is gone, and then this process is about to be.
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}
