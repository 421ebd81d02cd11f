//! The `mechid` program.

use std::io::Write as _;

fn main() -> std::process::ExitCode {
    // The message has no backtrace: a backtrace needs memory, and a program that fails for lack of
    // memory would wait for this memory for ever.
    std::panic::set_hook(Box::new(|panic| {
        let _ = writeln!(std::io::stderr(), "{panic}");
    }));
    #[cfg(unix)]
    signals::watch();
    if let Ok(program) = std::env::current_exe() {
        mechid_cli::set_worker_program(program, &[]);
    }
    mechid_cli::run(std::env::args_os())
}

#[cfg(unix)]
mod signals {
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    /// Removes unfinished outputs when a signal ends the program.
    pub fn watch() {
        // If no handler can be installed, an unfinished file remains until the same output is
        // written again.
        let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
        std::thread::spawn(move || {
            for signal in signals.forever() {
                mechid::io::remove_unfinished_files();
                let _ = emulate_default_handler(signal);
            }
        });
    }
}
