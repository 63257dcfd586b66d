/* A SoapySDR driver for a radio that is not there (SOAPY_SDR_PLUGIN_PATH). The directory
 * RADIO_WORLD is that of radio_library.c; it takes the rates of its file "rates" only. */
#include <SoapySDR/Device.hpp>
#include <SoapySDR/Errors.hpp>
#include <SoapySDR/Registry.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

static std::string content(const std::string &what)
{
	const char *world = std::getenv("RADIO_WORLD");
	std::ifstream file(std::string(world ? world : "/nowhere") + "/" + what);
	std::stringstream all;
	all << file.rdbuf();
	return all.str();
}

static void say(const std::string &text)
{
	std::ofstream(std::string(std::getenv("RADIO_WORLD")) + "/calls", std::ios::app) << text << "\n";
}

class Radio : public SoapySDR::Device
{
	double rate = 1e6, tuned = 0;
	long long given = 0, place = 0;
	std::chrono::steady_clock::time_point begun;

public:
	std::string getDriverKey() const override { return "standin"; }
	std::string getHardwareKey() const override { return "standin"; }
	size_t getNumChannels(const int) const override { return 1; }
	void setSampleRate(const int, const size_t, const double value) override
	{
		double best = 0;
		for (const auto &one : getSampleRateRange(0, 0))
			if (!best || std::abs(one.minimum() - value) < std::abs(best - value)) best = one.minimum();
		rate = best;
	}
	double getSampleRate(const int, const size_t) const override { return rate; }
	SoapySDR::RangeList getSampleRateRange(const int, const size_t) const override
	{
		SoapySDR::RangeList rates;
		std::istringstream all(content("rates"));
		for (double one; all >> one;) rates.emplace_back(one, one);
		return rates;
	}
	void setFrequency(const int, const size_t, const double value, const SoapySDR::Kwargs &) override { tuned = value; }
	double getFrequency(const int, const size_t) const override { return tuned < 24e6 ? 24e6 : tuned; }
	bool hasGainMode(const int, const size_t) const override { return true; }
	void setGainMode(const int, const size_t, const bool on) override { say(on ? "automatic gain" : "manual gain"); }
	void setGain(const int, const size_t, const double value) override { say("gain " + std::to_string(int(value))); }
	SoapySDR::ArgInfoList getSettingInfo() const override
	{
		SoapySDR::ArgInfo bias;
		bias.key = "biastee";
		return {bias};
	}
	void writeSetting(const std::string &key, const std::string &value) override { say(key + " " + value); }
	std::vector<std::string> getStreamFormats(const int, const size_t) const override { return {"CF32"}; }
	SoapySDR::Stream *setupStream(const int, const std::string &, const std::vector<size_t> &, const SoapySDR::Kwargs &) override
	{
		return reinterpret_cast<SoapySDR::Stream *>(this);
	}
	void closeStream(SoapySDR::Stream *) override {}
	int activateStream(SoapySDR::Stream *, const int, const long long, const size_t) override
	{
		begun = std::chrono::steady_clock::now();
		return 0;
	}
	int deactivateStream(SoapySDR::Stream *, const int, const long long) override { return 0; }
	int readStream(SoapySDR::Stream *, void *const *buffers, const size_t count, int &, long long &, const long timeout_us) override
	{
		const std::string fault = content("fault");
		if (fault == "unplugged" || fault == "absent" || fault == "busy" || fault == "forbidden") return SOAPY_SDR_STREAM_ERROR;
		if (fault == "stalls") {
			std::this_thread::sleep_for(std::chrono::microseconds(timeout_us));
			return SOAPY_SDR_TIMEOUT;
		}
		const double pace = fault == "other rate" ? 0.9 * rate : rate;
		const size_t some = std::min<size_t>(count, 4096);
		given += some;
		std::this_thread::sleep_until(begun + std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(given / pace)));
		if (fault == "loses" && given / some % 10 == 0) {
			given += some;
			place += some;
			return SOAPY_SDR_OVERFLOW;
		}
		float *out = static_cast<float *>(buffers[0]);
		const double step = 2 * M_PI * (std::stod(content("tag")) - tuned) / rate;
		for (size_t i = 0; i < some; i++, place++) {
			const long long in = place % (long long)rate;
			const double level = in < 0.02 * rate ? 0.05 : 0;
			out[2 * i] = level * std::cos(step * in) + 0.02 * (std::rand() / double(RAND_MAX) - 0.5);
			out[2 * i + 1] = level * std::sin(step * in) + 0.02 * (std::rand() / double(RAND_MAX) - 0.5);
		}
		return some;
	}
};

static SoapySDR::KwargsList find(const SoapySDR::Kwargs &wanted)
{
	SoapySDR::Kwargs one{{"driver", "standin"}, {"label", "stand-in"}, {"serial", "77"}};
	const auto serial = wanted.find("serial");
	const bool other = serial != wanted.end() && serial->second + "\n" != content("serials");
	const std::string fault = content("fault");
	return fault == "absent" || fault == "unplugged" || other ? SoapySDR::KwargsList{} : SoapySDR::KwargsList{one};
}

static SoapySDR::Device *make(const SoapySDR::Kwargs &wanted)
{
	if (find(wanted).empty()) throw std::runtime_error("standin device not found");
	if (content("fault") == "busy") throw std::runtime_error("Unable to open device: Resource busy");
	if (content("fault") == "forbidden") throw std::runtime_error("Unable to open device: Access denied (insufficient permissions)");
	return new Radio();
}

static SoapySDR::Registry registered("standin", &find, &make, SOAPY_SDR_ABI_VERSION);
