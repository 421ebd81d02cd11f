//! The `mechid` program.

fn main() -> std::process::ExitCode {
    mechid_cli::run(std::env::args_os())
}
