/* ---- C++17 ----
 *
 * What a library in C++ does at the boundary: nothing may unwind into the program, so every function of a table runs its
 * body in `lacuna::guard`.
 */
#if defined(__cplusplus) && __cplusplus >= 201703L

#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>

namespace lacuna {

/* What the program may try again with something else. */
struct Rejected : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/* Appends to the text of an answer. */
inline int32_t say(const LacunaAnswer *answer, std::string_view text, int32_t status = LACUNA_OK)
{
    lacuna_say(answer, text.data(), text.size());
    return status;
}

/* Runs a function behind the boundary: an exception becomes the text of a status. */
template <class Act>
int32_t guard(const LacunaAnswer *answer, Act act) noexcept
{
    try {
        act();
        return LACUNA_OK;
    } catch (const Rejected &reason) {
        return say(answer, reason.what(), LACUNA_REJECTED);
    } catch (const std::exception &error) {
        return say(answer, error.what(), LACUNA_STOP);
    } catch (...) {
        return say(answer, "an exception of an unknown type", LACUNA_STOP);
    }
}

/* The complaint about the value of an option. */
inline Rejected wrong_option(const std::string &key, const std::string &expected)
{
    return Rejected("[{\"at\":\"" + key + "\",\"message\":\"wrong value for `" + key + "`\",\"expected\":\"" + expected +
                    "\"}]");
}

/* The bytes of a text as they stand. */
inline std::string string_of(LacunaText text)
{
    return text.length == 0 ? std::string() : std::string(reinterpret_cast<const char *>(text.bytes), text.length);
}

} // namespace lacuna

#endif
