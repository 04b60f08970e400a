// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifdef _WIN32
#include "runtime/system/process.h"

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <io.h>
#include <windows.h>
// after windows.h
#include <psapi.h>
#include <shellapi.h>

namespace semrover::system {

namespace {

std::atomic<bool> seen = false, held = false;
HANDLE arrived = nullptr; // a semaphore

// on a thread that Windows makes for it
BOOL WINAPI on_control(DWORD event)
{
    if (held)
        return TRUE;
    seen = true;
    ::ReleaseSemaphore(arrived, 1, nullptr);
    if (event != CTRL_C_EVENT && event != CTRL_BREAK_EVENT)
        ::Sleep(INFINITE); // Windows ends the process when this returns
    return TRUE;
}

// as CommandLineToArgvW takes it apart
std::wstring command_line(const std::vector<std::string>& words)
{
    std::wstring line;
    for (const std::string& word : words) {
        line += line.empty() ? L"\"" : L" \"";
        size_t slashes = 0;
        const std::wstring wide = Path(word).native();
        for (const wchar_t c : wide) {
            if (c == L'"')
                line.append(slashes + 1, L'\\'); // those before a quote count twice
            slashes = c == L'\\' ? slashes + 1 : 0;
            line += c;
        }
        line.append(slashes, L'\\');
        line += L'"';
    }
    return line;
}

HANDLE inheritable(HANDLE handle)
{
    ::SetHandleInformation(handle, HANDLE_FLAG_INHERIT, HANDLE_FLAG_INHERIT);
    return handle;
}

OrError<HANDLE> start_with(const Path& program, const std::vector<std::string>& words, HANDLE input, HANDLE output)
{
    STARTUPINFOW begin{};
    begin.cb = sizeof begin;
    begin.dwFlags = STARTF_USESTDHANDLES;
    begin.hStdInput = inheritable(input);
    begin.hStdOutput = inheritable(output);
    begin.hStdError = inheritable(::GetStdHandle(STD_ERROR_HANDLE));
    PROCESS_INFORMATION process{};
    std::wstring line = command_line(words);
    const wchar_t* file = program.has_parent_path() ? program.c_str() : nullptr; // else words[0], on the PATH
    if (!::CreateProcessW(file, line.data(), nullptr, nullptr, TRUE, 0, nullptr, nullptr, &begin, &process))
        return tl::unexpected(::GetLastError() == ERROR_FILE_NOT_FOUND ? ENOENT : EACCES);
    ::CloseHandle(process.hThread);
    return process.hProcess;
}

int code_of(HANDLE process)
{
    DWORD code = 1;
    ::WaitForSingleObject(process, INFINITE);
    ::GetExitCodeProcess(process, &code);
    ::CloseHandle(process);
    return int(code);
}

HANDLE handle_of(int64_t id)
{
    return reinterpret_cast<HANDLE>(id);
}

} // namespace

void prepare_streams()
{
    for (std::FILE* stream : {stdin, stdout, stderr})
        ::_setmode(::_fileno(stream), _O_BINARY);
    ::SetConsoleOutputCP(CP_UTF8);
}

bool standard_error_is_terminal()
{
    return ::_isatty(::_fileno(stderr)) != 0;
}

std::vector<std::string> arguments(int, char**)
{
    int count = 0;
    wchar_t** const words = ::CommandLineToArgvW(::GetCommandLineW(), &count);
    std::vector<std::string> found;
    for (int i = 0; words && i < count; ++i)
        found.push_back(Path(words[i]).string());
    ::LocalFree(words);
    return found;
}

Path own_program()
{
    std::wstring name(32768, L'\0');
    name.resize(::GetModuleFileNameW(nullptr, name.data(), DWORD(name.size())));
    return name;
}

bool on_path(const std::string& program)
{
    return ::SearchPathW(nullptr, Path(program).c_str(), L".exe", 0, nullptr, nullptr) > 0;
}

HostMemory host_memory()
{
    PROCESS_MEMORY_COUNTERS counters{};
    if (!::K32GetProcessMemoryInfo(::GetCurrentProcess(), &counters, sizeof counters))
        return {};
    return {counters.WorkingSetSize, counters.PeakWorkingSetSize};
}

void watch_stop_requests()
{
    arrived = ::CreateSemaphoreW(nullptr, 0, 1 << 20, nullptr);
    ::SetConsoleCtrlHandler(on_control, TRUE);
}

bool stop_requested()
{
    return seen;
}

bool wait_for_stop_request(std::optional<double> seconds)
{
    return ::WaitForSingleObject(arrived, seconds ? DWORD(*seconds * 1000) : INFINITE) == WAIT_OBJECT_0;
}

void hold_stop_requests()
{
    held = true; // all programs of a console get them
}

void release_stop_requests()
{
    ::SetConsoleCtrlHandler(on_control, FALSE);
}

void give_all_threads_our_priority() {}

void exit_at_once(int code)
{
    ::TerminateProcess(::GetCurrentProcess(), UINT(code));
    std::abort();
}

int become(const Path& program, const std::vector<std::string>& words)
{
    Path file = program;
    file.replace_extension(".exe");
    const auto process = start_with(file, words, ::GetStdHandle(STD_INPUT_HANDLE), ::GetStdHandle(STD_OUTPUT_HANDLE));
    if (!process)
        return process.error();
    exit_at_once(code_of(*process));
}

OrError<Process> Process::start(const Path& program, const std::vector<std::string>& words, Pipe pipe)
{
    HANDLE read_end = nullptr, write_end = nullptr;
    if (pipe != Pipe::none && !::CreatePipe(&read_end, &write_end, nullptr, 0))
        return tl::unexpected(EMFILE);
    const bool input = pipe == Pipe::input;
    Path file = program;
    if (file.has_parent_path())
        file.replace_extension(".exe");
    const auto started = start_with(file, words, input ? read_end : ::GetStdHandle(STD_INPUT_HANDLE),
                                    pipe == Pipe::output ? write_end : ::GetStdHandle(STD_ERROR_HANDLE));
    if (pipe != Pipe::none)
        ::CloseHandle(input ? read_end : write_end);
    const HANDLE ours = input ? write_end : read_end;
    if (!started) {
        if (ours)
            ::CloseHandle(ours);
        return tl::unexpected(started.error());
    }
    Process process;
    process.id_ = reinterpret_cast<int64_t>(*started);
    if (ours)
        process.pipe = File(::_open_osfhandle(reinterpret_cast<intptr_t>(ours), _O_BINARY | _O_NOINHERIT));
    return process;
}

Process::~Process()
{
    if (!id_)
        return;
    kill(id_);
    (void)wait();
}

void Process::kill(int64_t id)
{
    ::TerminateProcess(handle_of(id), 1);
}

int Process::wait()
{
    (void)pipe.close();
    return code_of(handle_of(std::exchange(id_, 0)));
}

} // namespace semrover::system
#endif
