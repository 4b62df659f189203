"""First contact with the program: overview, shell completion, and compilation on the first run."""

import subprocess
import sys

import pytest
from numba import njit

from planish.cli import console
from planish.cli.main import app, run


@pytest.mark.parametrize("group", [(), ("acquire",), ("calibrate",)])
def test_every_command_has_a_description(group, capsys):
    assert run([*group, "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    commands = [name for name in (app[group[0]] if group else app).resolved_commands() if not name.startswith("-")]
    assert len(commands) >= 5
    for name in commands:
        (line,) = (line for line in lines if line.startswith(f"│ {name} "))
        assert len(line.strip("│ ").removeprefix(name).strip()) > 10, line


class TestCompletion:
    @pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
    def test_with_output_only_the_script_is_written(self, shell, tmp_path, monkeypatch, capsys):
        monkeypatch.setenv("HOME", str(tmp_path / "home"))
        script = tmp_path / "script"
        assert run(["install-completion", "--shell", shell, "-o", str(script)]) == 0
        assert (
            capsys.readouterr().out == f"Completion for {shell} was written to {script}; "
            "source it, or move it to the shell's completion folder.\n"
        )
        assert "restore" in script.read_text()
        assert "mass-spring" in script.read_text()  # choices as well
        assert not (tmp_path / "home").exists()

    def test_bash_completes_with_it(self, tmp_path):
        assert run(["install-completion", "--shell", "bash", "-o", str(tmp_path / "script"), "-q"]) == 0
        typed = 'COMP_WORDS=(planish restore scan.obj --method ""); COMP_CWORD=4'
        asked = f'source "$0"; {typed}; _planish; echo "${{COMPREPLY[@]}}"'
        said = subprocess.run(["bash", "-c", asked, tmp_path / "script"], capture_output=True, text=True, check=True)
        assert set(said.stdout.split()) == {"multigrid", "verlet", "mass-spring"}

    def test_without_output_it_is_installed_for_the_shell(self, tmp_path, monkeypatch, capsys):
        monkeypatch.setenv("HOME", str(tmp_path))
        monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
        assert run(["install-completion", "--shell", "fish"]) == 0
        assert (tmp_path / ".config" / "fish" / "completions" / "planish.fish").exists()
        assert "start a new shell" in capsys.readouterr().out

    def test_a_missing_folder_is_reported(self, tmp_path, capsys):
        assert run(["install-completion", "--shell", "bash", "-o", str(tmp_path / "none" / "script")]) == 4
        assert "there is no folder" in capsys.readouterr().err

    def test_an_unknown_shell_must_be_named(self, monkeypatch, capsys):
        from cyclopts.completion import detect

        def no_shell():
            raise detect.ShellDetectionError

        monkeypatch.setattr(detect, "detect_shell", no_shell)
        assert run(["install-completion"]) == 2
        assert "name it with --shell bash, zsh or fish" in capsys.readouterr().err


class TestFirstRun:
    def as_terminal(self, monkeypatch):
        """Pretend that stderr is a terminal."""
        monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
        monkeypatch.setattr("planish.display.progress.NOTE_COMPILE_SECONDS", 0.0)

    def test_a_note_says_that_compiling_happens_only_once(self, monkeypatch, capsys):
        self.as_terminal(monkeypatch)
        with console.progress_bar(quiet=False) as progress:
            progress("flatten", 0.5)
            njit(lambda x: x + 1)(1)
        assert "s of this, which happens only once" in capsys.readouterr().err

    def test_without_compiling_there_is_no_note(self, monkeypatch, capsys):
        self.as_terminal(monkeypatch)
        with console.progress_bar(quiet=False) as progress:
            progress("flatten", 0.5)
        assert "compiling" not in capsys.readouterr().err
