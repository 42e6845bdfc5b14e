//! What a confined process tries in vain, in a process of its own: what confines a thread is never taken back.

use super::{Confinement, Extent, Room, confine};
use nix::sys::signal::kill;
use nix::sys::stat::{FchmodatFlags, Mode, fchmodat};
use nix::unistd::{getppid, setsid};
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::Command;

/// Set to the folder of a test in the process that confines itself.
const ALONE: &str = "YOTO_TEST_CONFINED";
/// Set where a kernel without Landlock or seccomp is an error.
const REQUIRED: &str = "YOTO_TEST_CONFINEMENT";

/// Whether this kernel has all that the tests try; if not, it is said.
fn has_all() -> bool {
    let found = Confinement::of_this_machine().expect("tries");
    // Signals are refused by later kernels alone.
    if found.is_whole() && found.files == Extent::Full {
        return true;
    }
    assert!(std::env::var_os(REQUIRED).is_none(), "{found}");
    println!("skipped: {found}");
    false
}

/// What came of each attempt of the test `name` in a process that is confined to the folder `own`.
fn attempts(name: &str, outside: &Path, own: &Path) -> BTreeMap<String, String> {
    std::fs::create_dir(own).expect("makes");
    std::fs::write(own.join("upload"), "frames").expect("writes");
    std::fs::write(outside.join("database"), "keys").expect("writes");
    let tests = std::env::current_exe().expect("this program");
    let name = format!("confinement::tests::{name}");
    let mut alone = Command::new(tests);
    alone
        .args(["--exact", &name, "--nocapture"])
        .env(ALONE, outside);
    let out = alone.output().expect("runs");
    let said = String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success() && said.contains("1 passed"), "{said}");
    let lines = said.lines().filter_map(|line| line.split_once(" => "));
    lines.map(|(what, how)| (what.into(), how.into())).collect()
}

fn tell<T, E: Debug>(what: &str, outcome: Result<T, E>) {
    match outcome {
        Ok(_) => println!("\n{what} => done"),
        Err(error) => println!("\n{what} => {error:?}"),
    }
}

/// Tries all that a decoder has no use for, with `program` as the one that it may start.
fn try_all(outside: &Path, program: Option<&Path>) {
    let own = outside.join("own");
    let listener = TcpListener::bind("127.0.0.1:0").expect("binds");
    let address = listener.local_addr().expect("an address");
    let room = Room {
        folder: own.clone(),
        read: vec![outside.join("given")],
        program: program.map(Path::to_owned),
    };
    std::fs::write(outside.join("given"), "picture").expect("writes");
    let found = confine(&room).expect("confines");
    assert_eq!(found.calls, Extent::Full);
    let database = outside.join("database");
    tell("read own", std::fs::read(own.join("upload")));
    tell("write own", std::fs::write(own.join("shard"), "crops"));
    tell("read given", std::fs::read(outside.join("given")));
    tell("own figures", std::fs::read("/proc/self/status"));
    tell("a thread", std::thread::spawn(|| ()).join());
    tell("read database", std::fs::read(&database));
    tell("write given", std::fs::write(outside.join("given"), ""));
    tell("write database", std::fs::write(&database, ""));
    tell("create outside", std::fs::write(outside.join("new"), ""));
    tell("remove database", std::fs::remove_file(&database));
    tell("list outside", std::fs::read_dir(outside));
    let link = own.join("link");
    tell("link own", std::os::unix::fs::symlink(&database, &link));
    tell("read by link", std::fs::read(&link));
    let (mode, flags) = (
        Mode::from_bits_truncate(0o777),
        FchmodatFlags::FollowSymlink,
    );
    tell(
        "mode",
        fchmodat(nix::fcntl::AT_FDCWD, &database, mode, flags),
    );
    tell("tcp", TcpStream::connect(address));
    tell("udp", UdpSocket::bind("127.0.0.1:0"));
    tell("unix", UnixDatagram::unbound());
    tell("session", setsid());
    tell("signal", kill(getppid(), None));
    tell("start", Command::new("/bin/true").status());
    let cat = Command::new("/bin/cat").arg(&database).output();
    tell(
        "read by a program",
        match cat {
            Ok(out) if out.status.success() => Ok(()),
            Ok(out) => Err(String::from_utf8_lossy(&out.stderr).into_owned()),
            Err(error) => Err(error.to_string()),
        },
    );
}

const ALLOWED: [&str; 6] = [
    "read own",
    "write own",
    "read given",
    "own figures",
    "a thread",
    "link own",
];
const REFUSED: [&str; 14] = [
    "read database",
    "write given",
    "write database",
    "create outside",
    "remove database",
    "list outside",
    "read by link",
    "mode",
    "tcp",
    "udp",
    "unix",
    "session",
    "signal",
    "read by a program",
];

fn check(tried: &BTreeMap<String, String>, starts: bool) {
    let mut expected: BTreeMap<&str, bool> = ALLOWED.map(|what| (what, true)).into();
    expected.extend(REFUSED.map(|what| (what, false)));
    expected.insert("start", starts);
    let found: BTreeMap<&str, bool> = (tried.iter())
        .map(|(what, how)| (what.as_str(), how == "done"))
        .collect();
    assert_eq!(found, expected, "{tried:#?}");
}

#[test]
fn a_confined_process_has_its_folder_and_starts_nothing() {
    if let Some(outside) = std::env::var_os(ALONE) {
        return try_all(Path::new(&outside), None);
    }
    if has_all() {
        let outside = tempfile::tempdir().expect("a folder");
        let name = "a_confined_process_has_its_folder_and_starts_nothing";
        let tried = attempts(name, outside.path(), &outside.path().join("own"));
        check(&tried, false);
        // Not only the program's file is refused (EACCES), but a process for it.
        let refused = format!("Os {{ code: {},", nix::libc::EPERM);
        assert!(tried["start"].starts_with(&refused), "{tried:#?}");
    }
}

#[test]
fn a_program_that_a_confined_process_starts_is_confined_as_well() {
    if let Some(outside) = std::env::var_os(ALONE) {
        return try_all(Path::new(&outside), Some(Path::new("/bin/true")));
    }
    if has_all() {
        let outside = tempfile::tempdir().expect("a folder");
        let name = "a_program_that_a_confined_process_starts_is_confined_as_well";
        let tried = attempts(name, outside.path(), &outside.path().join("own"));
        check(&tried, true);
    }
}

#[test]
fn what_a_kernel_lacks_is_named() {
    let of = |files, calls| Confinement { files, calls };
    let whole = of(Extent::Partial, Extent::Full);
    assert!(whole.is_whole(), "{whole}");
    let without_files = of(Extent::None, Extent::Full);
    assert!(!without_files.is_whole());
    let said = without_files.to_string();
    assert!(
        said.contains("files: ALL OF THIS USER") && said.contains("network: none"),
        "{said}"
    );
    let without_calls = of(Extent::Full, Extent::None);
    assert!(!without_calls.is_whole());
    let said = without_calls.to_string();
    assert!(
        said.contains("files: its own alone") && said.contains("network: ALL"),
        "{said}"
    );
}
